"""The thesis' printed estimators, for comparison: `loaderhil --form printed`.

They share no equation with the corrected form, so that an edit of one cannot change the other; an import contract
holds that. Both use the same leaves: signals, parameters, plain quantities, the compiler. What is written in both
forms is written twice on purpose.
"""
