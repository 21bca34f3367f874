"""The machine: multibody dynamics, tyres, linkage, sensors, drive cases; the node is its shell."""
