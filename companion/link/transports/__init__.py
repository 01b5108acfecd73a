"""Transports of MAVLink messages: UDP, serial ports, memory."""
