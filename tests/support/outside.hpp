#pragma once

#include "coupling/schemes/reduced/ghost_model.hpp"
#include "coupling/select/border.hpp"
#include "support/bodies.hpp"

#include <algorithm>
#include <vector>

namespace subworld::test {

inline constexpr double kStep_s = 0.004;
inline constexpr double kCube_kg = 0.2;
inline constexpr double kWeight_n = kCube_kg * 9.81;
inline constexpr BodyId kFloor{0};

/// A floor and cubes; contacts are listed as forces.
struct Outside {
  explicit Outside(std::uint32_t cubes) {
    scene.bodies.push_back(floor_plane(kFloor));
    for (std::uint32_t i = 1; i <= cubes; ++i) scene.bodies.push_back(cube(BodyId{i}, 0.1, kCube_kg));
  }
  /// `towards`: from b to a.
  void touch(std::uint32_t a, std::uint32_t b, const Vec3& towards, double force_n) {
    contacts.push_back({.a = BodyId{a}, .b = BodyId{b}, .normal = towards, .normal_impulse = force_n * kStep_s});
  }
  /// All bodies have the same motion, except for their `accelerations` if given. The `unhung` bodies are at the border
  /// themselves, by their own contacts.
  std::vector<GhostModel> models(std::vector<BodyId> members, const Vec3& velocity = Vec3::Zero(),
                                 const Vec3& acceleration = Vec3::Zero(), const std::vector<BodyId>& unhung = {}) {
    const Membership membership{std::move(members), {kFloor}};
    std::vector<BoundaryContact> border;
    extract_border(contacts, membership, border);
    for (const Contact& c : contacts) {
      if (std::ranges::find(unhung, c.b) != unhung.end()) border.push_back(pair_of(c, c.a));
    }
    ContactGraph graph;
    graph.build(contacts, scene.bodies.size());
    std::vector<GhostModel> out;
    std::vector<Motion> motions(scene.bodies.size(),
                                {{.orientation = orientation, .linear_velocity = velocity}, acceleration});
    for (std::size_t i = 0; i < positions.size(); ++i) motions[i].state.position = positions[i];
    for (std::size_t i = 0; i < accelerations.size(); ++i) motions[i].acceleration = accelerations[i];
    GhostModeller(scene).model(border, {membership, graph, motions, kStep_s, pulls}, out, peers);
    return out;
  }

  Scene scene;
  std::vector<UserPull> pulls;   ///< of other users' devices
  std::vector<GhostPeer> peers;  ///< that were found
  std::vector<Contact> contacts;
  std::vector<Vec3> positions;  ///< by body; none: all in one place
  std::vector<Vec3> accelerations;
  Quat orientation = Quat::Identity();  ///< of all
};

// Cube 2 lies on the inside 1 and carries 3.
inline Outside carried() {
  Outside o(4);
  o.positions = {Vec3(0, 0, 0), Vec3(0, 0, 0.05), Vec3(0, 0, 0.15), Vec3(0.02, 0, 0.25), Vec3(0.1, 0, 0.15)};
  o.touch(1, 0, Vec3::UnitZ(), 3 * kWeight_n);
  o.touch(2, 1, Vec3::UnitZ(), 2 * kWeight_n);
  o.touch(3, 2, Vec3::UnitZ(), kWeight_n);
  return o;
}

}  // namespace subworld::test
