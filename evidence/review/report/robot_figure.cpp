// SPDX-License-Identifier: Apache-2.0
#include "evidence/review/report/robot_figure.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace takt::evidence {
namespace {

using Json = nlohmann::ordered_json;

double length_of(const config::Vector3& vector) {
  return std::hypot(vector[0], vector[1], vector[2]);
}

Json cart_pole_figure(const config::CartPole& cart, const config::RobotConfig& robot) {
  const config::Limits& limits = robot.joints.front().limits;
  const double travel = cart.pulley_radius * std::max(std::abs(limits.q_min), std::abs(limits.q_max));
  return {{"kind", "cart_pole"},
          {"pulley_radius", cart.pulley_radius},
          {"pole_length", cart.pole_length},
          {"reach", std::max(travel + 0.1, cart.pole_length)}};
}

Json links_figure(const config::Model& model, const std::vector<config::Joint>& joints) {
  Json links = Json::array();
  std::vector<double> reach;  // of each link's origin
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const config::Link& link = model.links[i];
    const bool slides = joints[i].kind == config::JointKind::slide;
    links.push_back({{"parent", link.parent}, {"xyz", link.origin_xyz}, {"rpy", link.origin_rpy}, {"axis", link.axis}});
    if (slides) links.back()["slides"] = true;
    const double before = link.parent < 0 ? 0 : reach[static_cast<std::size_t>(link.parent)];
    const double way = slides ? std::max(std::abs(joints[i].limits.q_min), std::abs(joints[i].limits.q_max)) : 0;
    reach.push_back(before + length_of(link.origin_xyz) + way);
  }
  Json figure{{"kind", "links"}, {"links", links}, {"tool", nullptr}};
  double farthest = *std::max_element(reach.begin(), reach.end());
  if (model.tool_link >= 0) {
    figure["tool"] = {{"link", model.tool_link}, {"xyz", model.tool_xyz}};
    farthest = std::max(farthest, reach[static_cast<std::size_t>(model.tool_link)] + length_of(model.tool_xyz));
  }
  figure["reach"] = farthest;
  return figure;
}

}  // namespace

Json robot_figure(const config::RobotConfig& robot) {
  if (robot.simulation && robot.simulation->cart_pole && robot.joints.size() >= 2) {
    return cart_pole_figure(*robot.simulation->cart_pole, robot);
  }
  if (robot.model && !robot.model->links.empty()) return links_figure(*robot.model, robot.joints);
  return nullptr;
}

}  // namespace takt::evidence
