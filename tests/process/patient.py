# SPDX-License-Identifier: Apache-2.0
"""patient(text): the demo arm's robot file for a machine that stalls now and then; a joint and a host may be silent for 200 ms and
500 ms before the executive and the simulated drives act on it. patient_copy.hpp says the same in C++."""

LONGER = (("  timeout: 20 ms", "  timeout: 200 ms"), ("drive_watchdog: 100 ms", "drive_watchdog: 500 ms"))


def patient(text):
    for usual, longer in LONGER:
        if text.count(usual) != 1:
            raise ValueError(f"`{usual}` stands {text.count(usual)} times in the robot file, not once")
        text = text.replace(usual, longer)
    return text
