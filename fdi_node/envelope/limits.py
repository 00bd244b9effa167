"""The numbers of the decision."""

from dataclasses import dataclass

from ac_common.units import KPA, RPM


@dataclass(frozen=True)
class Limits:
    """Numbers of the decision.

    Attributes
    ----------
    natural, likely, likely_open, likely_unknown, plain, certain : float
        Likelihood ratios (twice the logarithm) above which an air flow has jumped; a named fault is isolated if it is
        ahead, and where the plant's parameters are estimated, too; one without a name is; a fault of the compressor is
        isolated soon; it is certain that something is, so that it is detected: where the plant's parameters are
        estimated, with its name only.
    ahead, ahead_natural, ahead_share, rarer : float
        An explanation is ahead of another by the first, a jump of an air flow by the second; or by this share of its
        own ratio if that is more, because the model is linearised. One without a name counts less by the last: such
        faults are rarer, and a small one of the condenser pressure's sensor looks like one of the compressor.
    stuck : float
        A stuck valve counts so many times what it does, because when that began is only known to a window.
    patience_s, patience_certain_s : float
        A first fault needs less of a lead the longer it has been likely, by the square of time, and none after the
        first, or the second where it is certain that something is and it has a name: who waits on learns little more of
        which fault it is, while the observers that begin with a name do. What has no name and is certain is not waited
        for so.
    at_once, at_once_share, at_once_s : float
        A named fault that is ahead by this much, and by this share of its own ratio, and has begun no longer ago than
        the last, is isolated in the same tick, but where the plant's parameters are estimated: there a fault of the
        compressor needs this share to be isolated soon.
    hold_s, hold_unsure_s, hold_growing_s : float
        How long a fault of the compressor whose ratio is above `plain`, with a full lead, any other one (early in a
        fault of the compressor a jump of the pressure's sensor can explain as much), and one that grows must be ahead;
        anything must be certain for the second to be detected.
    after_natural_s : float
        For how long after a jump of an air flow a fault waits that has begun since, and is neither isolated at once nor
        a plain one of the compressor: the model is linearised.
    undecided_s : float
        How long an explanation is waited for when ratios are above `certain`. When they are not, as long as it takes.
    refuted, forget_open_s : float
        What has fallen by the first, as a share of the largest ratio, and by `likely`, is refuted: a true explanation's
        does not do that (with probability exp(-likely/2): Ville 1939), what linearisation has made up does. Where the
        plant's parameters are estimated true ones fall, too: there what has no name after the second is forgotten.
    clear_s, settle_s, afresh_s : float
        How long a fault must be gone to be over; for how long after the start nothing is concluded; for how long after
        that an observer that has begun anew must understand the readings for what was isolated before to be over.
    trust_s, explained_s, settle_open_s : float
        What seems to have begun before the first is taken for a plant whose parameters are others, where the design
        says that these may be estimated; so is an estimate that is beyond its threshold, before the second, while what
        explains most has begun before the first. Then nothing is concluded for the third.
    sigmas : float
        Thresholds of the named faults' estimates, in standard deviations of the filter,
    floor_rad_s, floor_pa : float
        and what is added to these.
    wander_s : float
        How long an estimate must be beyond its threshold.
    second, after_unknown_s : float
        Beside a fault that has not been isolated at once, another one must explain so many times what a move of the
        first does. Then, and for so long after something was unknown, what is not isolated at once has no name.
    restless_s, most_moves : float
        A fault that has moved more often than the second, each move forgotten with the time constant of the first, is
        unknown.
    inconsistent, consistent : float
        Mean square of the white innovations above which they are inconsistent, and below which they are not.
    lowest_rad_s, highest_rad_s, largest_pa : float
        What a named fault can be.
    better, kept, settled : float
        Likelihood ratios with which the other named fault takes the place of the one that has the name, and the name is
        sure; below which it is sure no longer; and with which the other one is no longer thought of.
    """

    natural: float = 25.0
    likely: float = 40.0
    likely_open: float = 150.0
    likely_unknown: float = 800.0
    plain: float = 120.0
    certain: float = 1000.0
    ahead: float = 10.0
    ahead_natural: float = 4.0
    ahead_share: float = 0.01
    rarer: float = 10.0
    stuck: float = 1.05
    patience_s: float = 45.0
    patience_certain_s: float = 15.0
    at_once: float = 60.0
    at_once_share: float = 0.15
    at_once_s: float = 3.0
    hold_s: float = 0.4
    hold_unsure_s: float = 3.0
    hold_growing_s: float = 10.0
    after_natural_s: float = 30.0
    undecided_s: float = 30.0
    refuted: float = 0.1
    forget_open_s: float = 15.0
    clear_s: float = 20.0
    settle_s: float = 20.0
    afresh_s: float = 10.0
    trust_s: float = 25.0
    explained_s: float = 60.0
    settle_open_s: float = 30.0
    sigmas: float = 5.0
    floor_rad_s: float = 1.5 * RPM
    floor_pa: float = 0.1 * KPA
    wander_s: float = 2.0
    second: float = 3.0
    after_unknown_s: float = 300.0
    restless_s: float = 60.0
    most_moves: float = 2.5
    inconsistent: float = 4.0
    consistent: float = 2.0
    lowest_rad_s: float = -100.0 * RPM
    highest_rad_s: float = 150.0 * RPM
    largest_pa: float = 20.0 * KPA
    better: float = 10.0
    kept: float = 5.0
    settled: float = 100.0

    def lead(self, ratio: float, waited_s: float, is_named: bool) -> float:
        """Return by how much an explanation with this ratio must be ahead after it has been waited for."""
        needed = max(self.ahead, self.ahead_share * ratio)
        if ratio > self.certain and not is_named:
            return needed
        patience_s = self.patience_certain_s if ratio > self.certain else self.patience_s
        return max(0.0, 1.0 - (waited_s / patience_s) ** 2) * needed
