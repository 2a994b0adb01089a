"""The example's speed limit, in Python and, compiled here, in C++: the same for any course of messages."""

import importlib.util
import math
import random
import subprocess
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[3] / "examples"
SPEC = importlib.util.spec_from_file_location("speed_limit", EXAMPLES / "shuttle_car/shuttle_car/speed_limit.py")
speed_limit = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(speed_limit)

FULL, SLOW = 3.0, 0.5
DRIVER = """
#include <iostream>
#include <string>
#include "speed_limit.hpp"
int main() {
  shuttle_car::SpeedLimit limit(3.0, 0.5);
  std::string kind;
  while (std::cin >> kind) {
    if (kind == "stop") {
      bool stop; long long beat; double valid, age, now;
      std::cin >> stop >> beat >> valid >> age >> now;
      limit.take_stop(stop, static_cast<std::uint32_t>(beat), valid, age, now);
    } else if (kind == "alarms") {
      bool warned; std::cin >> warned; limit.take_alarms(warned);
    } else {
      double wanted, now; std::cin >> wanted >> now;
      std::cout << limit.limited_m_s(wanted, now) << "\\n";
    }
  }
}
"""


def made():
    return speed_limit.SpeedLimit(speed_limit.Speeds(FULL, SLOW))


def permit(limit, number, now_s, **changes):
    message = {"stop": False, "heartbeat": number, "valid_for_s": 0.5, "age_s": 0.0, "now_s": now_s}
    limit.take_stop(**(message | changes))


def test_it_stands_until_two_beats_are_heard_and_creeps_until_the_alarms_are():
    limit = made()
    assert limit.limited_m_s(9.0, 0.0) == 0.0
    permit(limit, 1, 0.0)
    assert limit.limited_m_s(9.0, 0.0) == 0.0
    permit(limit, 2, 0.1)
    assert limit.limited_m_s(9.0, 0.1) == SLOW
    limit.take_alarms(warned=False)
    assert (limit.limited_m_s(9.0, 0.1), limit.limited_m_s(-9.0, 0.1)) == (FULL, -FULL)
    assert limit.limited_m_s(1.0, 0.1) == 1.0
    assert limit.limited_m_s(math.nan, 0.1) == 0.0


@pytest.mark.parametrize("change", [{"stop": True}, {"heartbeat": 2}, {"age_s": 0.6}, {"heartbeat": 50}])
def test_a_stop_a_dead_heart_and_an_old_message_stop_it(change):
    limit = made()
    permit(limit, 1, 0.0)
    permit(limit, 2, 0.0)
    permit(limit, 3, 0.0, **change)
    assert limit.limited_m_s(9.0, 0.0) == 0.0


def test_silence_stops_it():
    limit = made()
    permit(limit, 1, 0.0)
    permit(limit, 2, 0.0)
    assert limit.limited_m_s(9.0, 0.5) == SLOW
    assert limit.limited_m_s(9.0, 0.51) == 0.0


def test_the_c_plus_plus_example_limits_as_the_python_one(tmp_path):
    (tmp_path / "driver.cpp").write_text(DRIVER)
    words = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-I", EXAMPLES / "shuttle_car_cpp/src"]
    subprocess.run([*words, tmp_path / "driver.cpp", "-o", tmp_path / "driver"], check=True)
    rng, limit, lines, expected = random.Random(1), made(), [], []
    now_s, beat = 0.0, 2**32 - 200
    for _ in range(3000):
        now_s += rng.choice((0.0, 0.05, 0.05, 0.3))
        kind = rng.choice(("stop", "stop", "alarms", "speed"))
        if kind == "stop":
            beat = (beat + rng.choice((1, 1, 1, 2, 10, 11, 0, -1))) % 2**32
            stop, age_s = rng.random() < 0.1, rng.choice((0.0, 0.01, 0.2, 0.6, -0.1, -0.7))
            limit.take_stop(stop=stop, heartbeat=beat, valid_for_s=0.5, age_s=age_s, now_s=now_s)
            lines.append(f"stop {int(stop)} {beat} 0.5 {age_s!r} {now_s!r}")
        elif kind == "alarms":
            warned = rng.random() < 0.5
            limit.take_alarms(warned=warned)
            lines.append(f"alarms {int(warned)}")
        else:
            wanted = rng.choice((-5.0, 0.2, 1.0, 5.0))
            expected.append(limit.limited_m_s(wanted, now_s))
            lines.append(f"speed {wanted!r} {now_s!r}")
    found = subprocess.run([tmp_path / "driver"], input="\n".join(lines), capture_output=True, text=True, check=True)
    assert [float(line) for line in found.stdout.split()] == expected
    assert {0.0, SLOW, FULL, 1.0} <= set(expected)
