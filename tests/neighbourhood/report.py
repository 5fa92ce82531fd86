"""Result of the checks of a history: the violations, and the largest value of each check over its
tolerance."""

from dataclasses import dataclass, field

import numpy as np

# most violations stored per check; the others are counted
KEPT = 3


@dataclass
class Report:
    """Violations by check, and the largest measured value over its tolerance."""

    violations: dict = field(default_factory=dict)
    counts: dict = field(default_factory=dict)
    margins: dict = field(default_factory=dict)
    # numbers of the history that are reported without a check
    figures: dict = field(default_factory=dict)

    def expect(self, check, measured, allowed, describe):
        """`measured` ≤ `allowed`, element by element; not a number is a violation.
        `describe(index)` says where."""
        measured, allowed = np.broadcast_arrays(np.asarray(measured, float), np.asarray(allowed, float))
        self.margins.setdefault(check, 0.0)
        if measured.size == 0:
            return
        wrong = ~(measured <= allowed)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(measured <= 0.0, 0.0, measured / allowed)
        self.margins[check] = max(self.margins[check], float(np.nan_to_num(ratio, nan=np.inf).max()))
        if not wrong.any():
            return
        places = np.argwhere(wrong)
        self.counts[check] = self.counts.get(check, 0) + len(places)
        kept = self.violations.setdefault(check, [])
        for place in places[: KEPT - len(kept)]:
            place = tuple(map(int, place))
            kept.append(f"{describe(*place)}: {measured[place]:.6g}, allowed {allowed[place]:.3g}")

    def require(self, check, holds, text):
        """Records a condition as fulfilled or violated."""
        self.margins.setdefault(check, 0.0)
        if not holds:
            self.counts[check] = self.counts.get(check, 0) + 1
            kept = self.violations.setdefault(check, [])
            if len(kept) < KEPT:
                kept.append(text)

    @property
    def wrong(self):
        """Names of the checks that failed."""
        return sorted(self.violations)

    def lines(self):
        """The report as lines of text."""
        out = [f"{name}: {value}" for name, value in self.figures.items()]
        for check in sorted(self.margins):
            verdict = f"WRONG {self.counts[check]} times" if check in self.violations else "right"
            out.append(f"{check:28} {verdict:18} largest value over its tolerance {self.margins[check]:.2g}")
            out.extend(f"    {text}" for text in self.violations.get(check, []))
        return out
