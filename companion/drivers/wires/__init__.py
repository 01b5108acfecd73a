"""I2C, SPI and serial: the interface that drivers use, and who serves it."""
