"""CAN of the Linux kernel (SocketCAN): raw socket, interface state, kernel time stamps."""
