"""Who may ask for what: only this machine, or whoever holds the token; only pages that came from here.

A page of another site may make a browser send requests here, also under a name that it has pointed at 127.0.0.1 (DNS
rebinding). So the name asked for (Host) must be one of ours, the page that asks (Origin) must be this one, and nothing
is changed without a header that another site's page cannot send unasked.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Iterable, Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOCAL = ("127.0.0.1", "localhost", "[::1]")
COOKIE = "signlin_token"
ASKED_BY_PAGE = "x-signlin"
"""A header that the page sends with whatever changes something."""
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:;"
    " connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-cache",
}
REPORT_POLICY = "default-src 'none'; img-src 'self' data:; style-src 'unsafe-inline'; frame-ancestors 'none'; sandbox"
"""Of a report: pictures and styles, and no script at all."""


def new_token() -> str:
    """Return a token that nobody guesses."""
    return secrets.token_urlsafe(24)


class Gate:
    """Lets through what may pass, and refuses the rest in one line that says why."""

    def __init__(self, app: ASGIApp, hosts: Iterable[str], token: str | None) -> None:
        self.app, self.hosts, self.token = app, frozenset(hosts), token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        why = self._refusal(scope, headers)
        if why:
            await PlainTextResponse(f"refused: {why}\n", 403)(scope, receive, send)
        elif self.token is not None and self._in_query(scope):
            await self._with_cookie(scope, receive, send)
        else:
            await self.app(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope, headers: Headers) -> str:
        host = headers.get("host", "")
        if self.token is None and name_of(host) not in self.hosts:
            return f"this page answers to {', '.join(sorted(self.hosts))} only, not to {host[:100]!r}"
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return f"the request comes from another site, {origin[:100]!r}"
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            return "the request comes from another site"
        if scope["method"] not in ("GET", "HEAD") and ASKED_BY_PAGE not in headers:
            return f"the header {ASKED_BY_PAGE} is missing"
        if self.token is not None and not (self._in_cookie(headers) or self._in_query(scope)):
            return "the token is missing: open the address that signlin printed when it was started"
        return ""

    def _in_cookie(self, headers: Headers) -> bool:
        try:
            morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return morsel is not None and self._right(morsel.value)

    def _in_query(self, scope: Scope) -> bool:
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        return bool(given) and self._right(given)

    def _right(self, given: str) -> bool:
        return self.token is not None and hmac.compare_digest(given.encode(), self.token.encode())

    async def _with_cookie(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Take the token out of the address, where histories and shoulders see it, into a cookie."""
        answer = RedirectResponse(scope["path"], 303)
        answer.set_cookie(COOKIE, self.token or "", httponly=True, samesite="strict", path="/")
        await answer(scope, receive, _with_headers(send))


def name_of(host: str) -> str:
    """Return the name in a Host header, without its port."""
    return host.rsplit(":", 1)[0].lower() if ":" in host.rsplit("]", maxsplit=1)[-1] else host.lower()


def _with_headers(send: Send, more: Mapping[str, str] = HEADERS) -> Send:
    async def sent(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in more.items():
                headers.setdefault(name, value)
        await send(message)

    return sent


__all__ = ["COOKIE", "HEADERS", "LOCAL", "REPORT_POLICY", "Gate", "name_of", "new_token"]
