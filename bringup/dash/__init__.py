"""The live page: a local web page beside a running graph, to watch it and to break things on it.

`rows` and `cycle` are pure; `link` is the page's ROS node; `page` draws; `server` serves, and keeps out who has no
business there.
"""
