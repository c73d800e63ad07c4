// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/perturbation.hpp"

#include <algorithm>
#include <cmath>

namespace takt::evidence {
namespace {

Duration milliseconds_of(double dose) {
  return {std::llround(dose * 1e6)};
}

}  // namespace

Disturbance::Disturbance(const Perturbation& perturbation, MonoTime rollout_started) {
  add(perturbation, rollout_started);
  for (const Perturbation& besides : perturbation.with) add(besides, rollout_started);
}

void Disturbance::add(const Perturbation& perturbation, MonoTime rollout_started) {
  const MonoTime begins = rollout_started + perturbation.from;
  const bool by_dose = row_of(perturbation.trouble).real.when == trouble::When::for_dose;
  const MonoTime ends = begins + (by_dose ? milliseconds_of(perturbation.dose) : perturbation.length);
  strikes_[static_cast<std::size_t>(perturbation.trouble)] = {true, perturbation.dose, begins, ends, perturbation.body};
  begins_ = begins_.is_set() ? std::min(begins_, begins) : begins;
  ends_ = std::max(ends_, ends);
}

Duration Disturbance::delay(Trouble trouble, MonoTime at) const {
  const double ms = dose(trouble, at);
  return ms == 0 ? Duration{} : milliseconds_of(ms);
}

std::int64_t Disturbance::turn(Trouble trouble, MonoTime at) const {
  if (dose(trouble, at) == 0) return 0;
  return (at - begins(trouble)).ns / kRepeat.ns + 1;
}

bool Disturbance::in_first_part(Trouble trouble, MonoTime at) const {
  const std::int64_t turn_now = turn(trouble, at);
  return turn_now != 0 && at - begins(trouble) - kRepeat * (turn_now - 1) < delay(trouble, at);
}

}  // namespace takt::evidence
