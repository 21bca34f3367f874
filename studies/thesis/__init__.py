"""The open questions of the thesis, each answered by one command: drives, printed and corrected estimators, page and picture."""
