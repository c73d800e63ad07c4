#include "drivers/make_driver.hpp"

#include <cmath>

#include "drivers/mit_driver.hpp"

namespace takt::drivers {
namespace {

bool is_positive(float x) {
  return std::isfinite(x) && x > 0;
}

std::unexpected<std::string> refusal(const config::Joint& joint, const std::string& what) {
  return std::unexpected("joint " + joint.name + ": " + what);
}

std::expected<std::unique_ptr<JointDriver>, std::string> make_mit(const config::Joint& joint) {
  const config::Drive& drive = joint.drive;
  MitDriveSettings settings;
  if (drive.variant == "damiao")
    settings.variant = MitVariant::damiao;
  else if (drive.variant == "tmotor")
    settings.variant = MitVariant::tmotor;
  else
    return refusal(joint, "mit variant '" + drive.variant + "' is unknown: write tmotor or damiao");
  settings.range = {static_cast<float>(drive.position_range), static_cast<float>(drive.velocity_range),
                    static_cast<float>(drive.kp_range), static_cast<float>(drive.kd_range),
                    static_cast<float>(drive.torque_range)};
  const MitRange& range = settings.range;
  if (!is_positive(range.p) || !is_positive(range.v) || !is_positive(range.kp) || !is_positive(range.kd) ||
      !is_positive(range.t))
    return refusal(joint, "the drive's packed ranges are not all positive: name a model or give every range");
  if (drive.id > 0x7FF || drive.reply_id > 0x7FF)
    return refusal(joint, "mit drives have 11-bit ids: id and reply_id must be at most 0x7FF");
  if (std::abs(drive.direction) != 1 || !is_positive(static_cast<float>(drive.gear_ratio)))
    return refusal(joint, "direction must be 1 or -1 and gear_ratio positive");
  settings.id = drive.id;
  settings.reply_id = drive.reply_id;
  settings.direction = static_cast<float>(drive.direction);
  settings.offset = static_cast<float>(drive.offset);
  settings.gear_ratio = static_cast<float>(drive.gear_ratio);
  return std::make_unique<MitDriver>(settings);
}

}  // namespace

std::expected<std::unique_ptr<JointDriver>, std::string> make_joint_driver(const config::Joint& joint) {
  if (joint.drive.protocol == "mit") return make_mit(joint);
  return refusal(joint, "drive protocol '" + joint.drive.protocol + "' is unknown: this build speaks mit");
}

}  // namespace takt::drivers
