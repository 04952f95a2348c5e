"""Configuration and network beside an exported route file.

They are replaced only if an export wrote them. The configuration ends with a comment that holds its own SHA-256 and
that of the network beside it. A file that does not match such a comment is the user's.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from idm_sumo.runtime.errors import InputError

SIGNATURE = re.compile(
    rb"\n<!-- idm-sumo export: sha256 of the lines above ([0-9a-f]{64}), of the network ([0-9a-f]{64}) -->\n?$"
)


@dataclass(frozen=True)
class Companions:
    """Files beside a route file.

    Attributes
    ----------
    config, net : Path
        ``NAME.sumocfg`` and ``NAME.net.xml``.
    source : Path
        The network that ``net`` is a copy of.
    """

    config: Path
    net: Path
    source: Path

    @classmethod
    def of(cls, routes: Path, source: Path) -> Companions:
        """Return the companions of a route file.

        Parameters
        ----------
        routes : Path
            ``NAME.rou.xml``.
        source : Path
            The network to copy.

        Returns
        -------
        Companions
        """
        stem = routes.name.removesuffix(".xml").removesuffix(".rou")
        return cls(routes.with_name(f"{stem}.sumocfg"), routes.with_name(f"{stem}.net.xml"), source)

    @property
    def net_is_there(self) -> bool:
        """Whether the network beside it is the wanted one."""
        return self.net.is_file() and _sha256(self.net.read_bytes()) == _sha256(self.source.read_bytes())

    def refuse_others(self) -> None:
        """Refuse to replace a file that no export wrote.

        Raises
        ------
        InputError
            Names the file.
        """
        own, net = _signed(self.config)
        if self.config.exists() and not own:
            raise InputError(_not_ours(self.config))
        if (
            self.net.exists()
            and not self.net_is_there
            and not (self.net.is_file() and _sha256(self.net.read_bytes()) == net)
        ):
            raise InputError(_not_ours(self.net))

    def sign(self, config: Path) -> None:
        """Append the signing comment to a configuration.

        Parameters
        ----------
        config : Path
            Where it was written.
        """
        text = config.read_bytes().removesuffix(b"\n")
        of_net = _sha256(self.source.read_bytes())
        signature = f"\n<!-- idm-sumo export: sha256 of the lines above {_sha256(text)}, of the network {of_net} -->\n"
        config.write_bytes(text + signature.encode())


def _not_ours(path: Path) -> str:
    return f"{path}: was not written by `export`, or was changed since; move it away, or give the output another name"


def _signed(config: Path) -> tuple[bool, str]:
    """Return whether a configuration is unchanged since its export.

    With it the fingerprint of the network beside it.
    """
    text = config.read_bytes() if config.is_file() else b""
    found = SIGNATURE.search(text)
    if found is None or _sha256(text[: found.start()]) != found[1].decode():
        return False, ""
    return True, found[2].decode()


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
