"""The transport that a URL names."""

from companion.config import LinkConfig
from companion.link.serial_transport import SerialTransport
from companion.link.transport import UdpTransport


def open_transport(config: LinkConfig) -> UdpTransport | SerialTransport:
    """UDP or a serial port.

    Raises:
        LinkError: it cannot be used; names the url and the remedy.
    """
    kind = SerialTransport if config.url.startswith("serial:") else UdpTransport
    return kind(config.url, config.system_id, config.component_id)
