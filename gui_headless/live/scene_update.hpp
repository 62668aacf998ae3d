#pragma once

#include "model/messages/exchange.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::live {

/// The world as `foxglove::SceneUpdate`, CDR with its header. Entities: `fixed`, `bodies`, `joints` and `forces` (an
/// arrow at each proxy with the force on its operator, `kArrow_m_per_n` long per newton; `forces_n`: by user). Each
/// message has all bodies, so that a client may miss any. Colours as in the picture: proxies are red, members blue,
/// border bodies yellow, other movable bodies light grey, joints magenta.
[[nodiscard]] std::vector<std::uint8_t> scene_update(const SceneDescription& scene, std::span<const BodyState> states,
                                                     std::span<const UserView> users, std::span<const Vec3> forces_n,
                                                     std::span<const std::uint32_t> broken_joints,
                                                     std::uint64_t time_ns);

inline constexpr double kArrow_m_per_n = 0.02;

}  // namespace subworld::live
