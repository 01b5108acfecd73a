"""The transport that a URL names."""

from companion.config import LinkConfig
from companion.link.serial_transport import SerialTransport
from companion.link.signing import load_signing
from companion.link.transport import UdpTransport


def open_transport(config: LinkConfig) -> UdpTransport | SerialTransport:
    """UDP or a serial port.

    Raises:
        LinkError: it cannot be used; names the url and the remedy.
    """
    kind = SerialTransport if config.url.startswith("serial:") else UdpTransport
    signing = None
    if config.signing_key is not None:
        signing = load_signing(config.signing_key, config.signing_timestamp)
    return kind(config.url, config.system_id, config.component_id, signing)
