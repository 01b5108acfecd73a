"""The transport that a URL names."""

from companion.config.settings import LinkConfig
from companion.link.signing import Warn, load_signing
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import UdpTransport


def open_transport(
    config: LinkConfig, warn: Warn = lambda _: None, *, in_the_air: bool = False
) -> UdpTransport | SerialTransport:
    """UDP or a serial port; `warn` hears what goes wrong with the signing's time stamp later.

    `in_the_air`: a drone may be flying, so a time stamp that cannot be read or kept is no reason to
    refuse.

    Raises:
        LinkError: it cannot be used; names the url and the remedy.
    """
    kind = SerialTransport if config.url.startswith("serial:") else UdpTransport
    signing = None
    if config.signing_key is not None:
        key_file, kept = config.signing_key, config.signing_timestamp
        signing = load_signing(key_file, kept, warn, refuses=not in_the_air)
    return kind(config.url, config.system_id, config.component_id, signing)
