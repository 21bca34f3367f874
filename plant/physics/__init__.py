"""Equations of motion and what they are made of: bodies, joints, tyres, linkage, steering, relief valves, rest."""
