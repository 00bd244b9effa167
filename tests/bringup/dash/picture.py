"""Draw docs/live.png: ``python tests/bringup/dash/picture.py``, about two minutes."""

import re
from pathlib import Path

from playwright.sync_api import Page

from tests.live_browser import acftc, new_page, newest, started_browser, until

TARGET = Path(__file__).parents[3] / "docs" / "live.png"
DOMAIN = 98
#: How long to look at each event, s.
LOOK_S = 30.0


def click(page: Page, name: str) -> None:
    """Click a button."""
    page.get_by_role("button", name=name, exact=True).click()


def main() -> None:
    """Inject both faults, move a reference, and take the picture."""
    with started_browser() as browser, acftc("dash", "--no-browser", domain=DOMAIN) as (url, _):
        page = new_page(browser)
        page.goto(url)
        until(lambda: newest(page, "t") > 10.0, "no row has come")
        for button in ("Inject f_N", "Inject f_p"):
            click(page, button)
            page.wait_for_timeout(LOOK_S * 1e3)
        page.get_by_label("SH reference, K").fill("-2.5")
        page.get_by_label("SH reference, K").press("Enter")
        click(page, "Apply")
        until(lambda: re.search("SH reference", page.locator(".said").inner_text()), "the reference stays")
        page.wait_for_timeout(LOOK_S * 1e3)
        page.screenshot(path=TARGET)


if __name__ == "__main__":
    main()
