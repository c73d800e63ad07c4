// SPDX-License-Identifier: Apache-2.0
// Keys of one joint, declared once for both kinds: the units, defaults and ranges that they have of a hinge and of a
// slide. Where a value is in the other kind's unit, the complaint says how the joint becomes one of that kind.
#pragma once

#include <optional>
#include <string_view>

#include "config/fields.hpp"
#include "config/joint_units.hpp"

namespace takt::config {

struct JointKey {
  std::string_view name, doc;
  struct Default {
    std::string_view hinge, slide;
  };
  std::optional<Default> otherwise{};  // none: the key is required
};

// In base units, of a hinge and of a slide.
struct JointRange {
  Range hinge, slide;
};

class JointKeys {
 public:
  JointKeys(Fields& fields, JointKind kind) : fields_(fields), slides_(kind == JointKind::slide) {}

  void quantity(const JointKey& key, double& value, const JointQuantity& what, const JointRange& range) const {
    fields_.quantity(key_of(key, what), value, slides_ ? what.slide : what.hinge, slides_ ? range.slide : range.hinge);
  }
  void quantity(const JointKey& key, double& value, const JointQuantity& what, Range range) const {
    quantity(key, value, what, {range, range});
  }
  void interval(const JointKey& key, double& low, double& high, const JointQuantity& what, Range range) const {
    fields_.interval(key_of(key, what), low, high, slides_ ? what.slide : what.hinge, range);
  }

 private:
  [[nodiscard]] Key key_of(const JointKey& key, const JointQuantity& what) const {
    Key made{.name = key.name, .doc = key.doc};
    if (key.otherwise) made.otherwise = slides_ ? key.otherwise->slide : key.otherwise->hinge;
    made.other = slides_ ? Key::Other{what.hinge, "leave `kind: slide` out"}
                         : Key::Other{what.slide, "write `kind: slide` into the joint"};
    return made;
  }

  Fields& fields_;
  bool slides_;
};

}  // namespace takt::config
