"""Opens the transport of the configured URL."""

from companion.config.settings import LinkConfig
from companion.link.signing import Warn, load_signing
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import UdpTransport


def open_transport(
    config: LinkConfig, warn: Warn = lambda _: None, *, in_the_air: bool = False
) -> UdpTransport | SerialTransport:
    """Open UDP or a serial port; `warn` receives later problems with the signing time stamp.

    `in_the_air`: a drone may be in flight, so an unusable time stamp file is not an error.

    Raises:
        LinkError: the transport cannot be opened; the message names the URL and the remedy.
    """
    kind = SerialTransport if config.url.startswith("serial:") else UdpTransport
    signing = None
    if config.signing_key is not None:
        key_file, kept = config.signing_key, config.signing_timestamp
        signing = load_signing(key_file, kept, warn, refuses=not in_the_air)
    return kind(config.url, config.system_id, config.component_id, signing)
