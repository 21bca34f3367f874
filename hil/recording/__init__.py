"""Recording a bus off the control path, and playing recordings back."""
