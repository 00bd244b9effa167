"""Draw docs/live.png: ``python tests/bringup/dash/picture.py``, about two minutes."""

from pathlib import Path

from playwright.sync_api import Page

from tests.live_browser import acftc, new_page, newest, started_browser, until

TARGET = Path(__file__).parents[3] / "docs" / "live.png"
DOMAIN = 98
#: Nothing is looked for while the observer settles, s.
SETTLED_S = 25.0
#: How long to look at each event, s.
LOOK_S = 30.0


def click(page: Page, name: str) -> None:
    """Click a button."""
    page.get_by_role("button", name=name, exact=True).click()


def main() -> None:
    """Move the load, inject a fault, and take the picture."""
    with started_browser() as browser, acftc("dash", "--no-browser", domain=DOMAIN) as (url, _):
        page = new_page(browser)
        page.goto(url)
        until(lambda: newest(page, "t") > SETTLED_S, "no row has come")
        for button in ("traffic", "Inject f_p"):
            click(page, button)
            page.wait_for_timeout(LOOK_S * 1e3)
        page.screenshot(path=TARGET)


if __name__ == "__main__":
    main()
