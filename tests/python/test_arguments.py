"""Arguments that cannot be meant are refused by name before anything is sent: there is no service behind these clients."""

import pytest

import feedwave
import feedwave.aio

NOWHERE = "127.0.0.1:1"


@pytest.mark.parametrize("address", ["http://", "http://host:port/x", "http://host:1/x", "host", "host:70000", "who@host:1", "http://a b:1", "ftp://host:1", "host:0"])
def test_an_address_that_is_none_is_refused(address):
    for connect in (feedwave.connect, feedwave.aio.connect):
        with pytest.raises(feedwave.SourceError, match="the address is HOST:PORT, http://HOST:PORT or https://HOST:PORT"):
            connect(address)


def test_addresses_are_those_of_the_commands():
    from feedwave._connection import target

    def place(address):
        found = target(address, None, None, None, None, None, None)
        return found.address, found.credentials is not None

    assert place("host:1") == place("http://host:1/") == ("host:1", False)
    assert place("http://host") == ("host:80", False) and place("https://host") == ("host:443", True)
    assert place("[::1]:5") == place("http://[::1]:5") == ("[::1]:5", False)


def test_a_token_is_what_a_header_can_carry():
    from feedwave._connection import target

    def metadata(token, tenant=None):
        return target(NOWHERE, token, tenant, None, None, None, None).metadata

    # As `feedwave token … > p.tok` writes it.
    assert metadata("secret\n") == metadata(" secret\r\n") == (("authorization", "Bearer secret"),)
    for wrong, told in [("sec\nret", r"character 4 is U\+000A"), ("sécret", r"character 2 is U\+00E9"), (" \n", "nothing but white space")]:
        with pytest.raises(feedwave.SourceError, match=f"^token: .*{told}") as caught:
            metadata(wrong)
        assert wrong not in str(caught.value)
        with pytest.raises(feedwave.SourceError, match="^tenant: "):
            metadata("secret", wrong)
    with pytest.raises(TypeError, match="^token: a str is wanted, not bytes"):
        metadata(b"secret")
