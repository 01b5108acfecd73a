"""How MAVLink messages travel: UDP, serial ports, memory."""
