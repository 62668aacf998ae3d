#include "coupling/tool/tool.hpp"

namespace subworld {

Tool tool_at(double rate, const UserSpec& user, const Body& proxy) noexcept {
  Tool tool{user.coupling, nameless(proxy)};
  tool.coupling.damping_n_s_m *= rate;
  tool.coupling.rotational_damping_n_m_s *= rate;
  tool.body.mass *= rate * rate;
  tool.body.inertia *= rate * rate;
  return tool;
}

BodyState at_rate(BodyState proxy, double before, double after) noexcept {
  proxy.linear_velocity *= before / after;
  proxy.angular_velocity *= before / after;
  return proxy;
}

}  // namespace subworld
