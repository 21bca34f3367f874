"""What the tests of deployment share: the exported folder."""

from tests.deploy.c.conftest import ecu_sources

__all__ = ["ecu_sources"]
