"""How soon the machine is on its safe limits when something breaks, on CAN interfaces of the kernel."""
