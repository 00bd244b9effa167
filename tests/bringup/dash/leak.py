"""Does the live page grow? Memory of server and browser over time, with a browser connected and the loop running.

Also what one update costs: processor time of the server, and of the page's main thread, for each update that came.

``python tests/bringup/dash/leak.py --minutes 60`` prints a line a minute. The plots hold five minutes: what fills them
comes in the first five and is no leak; the last line compares the end with the time when they were full.
"""

import argparse
import os
import time
from typing import Any

import psutil

from bringup.dash.rows import WINDOW_S
from tests.live_browser import acftc, new_page, newest, started_browser, until

MB = 1e6
#: The plots are full, and what is compiled and cached on the way is there.
SETTLED_S = WINDOW_S + 60.0


def resident(process: int) -> float:
    """Memory of a process in the machine's, MB."""
    return psutil.Process(process).memory_info().rss / MB


def processor_s(process: int) -> float:
    """Processor time that a process has had, s."""
    used = psutil.Process(process).cpu_times()
    return used.user + used.system


def metrics(session: Any) -> dict[str, float]:
    """What the browser counts of the page."""
    return {item["name"]: item["value"] for item in session.send("Performance.getMetrics")["metrics"]}


def heap(session: Any) -> float:
    """Live JavaScript objects of the page after a collection, MB."""
    session.send("HeapProfiler.collectGarbage")
    return metrics(session)["JSHeapUsedSize"] / MB


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    minutes = parser.parse_args().minutes
    domain = int(os.environ.get("ROS_DOMAIN_ID", "77"))
    with started_browser() as browser, acftc("dash", "--no-browser", domain=domain) as (url, server):
        page = new_page(browser)
        page.goto(url)
        until(lambda: newest(page, "t") > 0.0, "no row has come")
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable", {"timeDomain": "threadTicks"})  # of the processor, not of the wall
        page.evaluate(
            """() => { window.updates = 0
            Bokeh.documents[0].on_change((event) => { if (event.kind == "ColumnsStreamed") window.updates += 1 }) }"""
        )
        print(
            "minute  updates/s  rows on the page  server RSS, MB  JS heap, MB  ms an update: server  page", flush=True
        )
        used_s = processor_s(server.pid), metrics(session)["TaskDuration"]
        started_s = seen_s = time.monotonic()
        settled: tuple[float, float] | None = None
        while time.monotonic() - started_s < minutes * 60.0:
            page.wait_for_timeout(60e3)
            updates, rows = page.evaluate(
                """() => { const n = window.updates; window.updates = 0
                return [n, Bokeh.documents[0].get_model_by_name("rows").get_length()] }"""
            )
            now = time.monotonic()
            before_s, used_s = used_s, (processor_s(server.pid), metrics(session)["TaskDuration"])
            cost_ms = [1e3 * (end - begin) / max(updates, 1) for begin, end in zip(before_s, used_s, strict=True)]
            figures = resident(server.pid), heap(session)
            if settled is None and now - started_s > SETTLED_S:
                settled = figures
            print(
                f"{(now - started_s) / 60.0:6.1f}  {updates / (now - seen_s):9.1f}  {rows:16d}"
                f"  {figures[0]:14.1f}  {figures[1]:11.1f}  {cost_ms[0]:20.1f}  {cost_ms[1]:4.1f}",
                flush=True,
            )
            seen_s = now
        if settled is not None:
            server_more, heap_more = (end - begin for begin, end in zip(settled, figures, strict=True))
            print(f"since the plots were full: server {server_more:+.1f} MB, JS heap {heap_more:+.1f} MB")


if __name__ == "__main__":
    main()
