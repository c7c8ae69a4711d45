"""Progress line on stderr, for ``progress=True``."""

import sys


class Line:
    """Rewrites one line of a terminal; elsewhere a line for every tenth of the work."""

    def __init__(self):
        self._tenth = -1
        self._width = 0

    def __call__(self, step):
        if sys.stderr is None:
            return
        done, total = step["done"], max(step["total"], 1)
        left = "" if step["left_s"] is None else f", about {step['left_s']:.0f} s left"
        text = f"{done}/{total}{left}: {step['what']}"
        if sys.stderr.isatty():
            last = done + 1 >= total
            print("\r" + text.ljust(self._width)[:120], end="\n" if last else "", file=sys.stderr, flush=True)
            self._width = 0 if last else len(text)
        elif 10 * done // total > self._tenth:
            self._tenth = 10 * done // total
            print(text, file=sys.stderr, flush=True)
