"""I2C, SPI and serial wires: the interface of the drivers, and its implementations."""
