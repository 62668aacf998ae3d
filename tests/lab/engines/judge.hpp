#pragma once

#include "model/scene/scene.hpp"
#include "physics/engine.hpp"

#include <vector>

/// Criteria for an engine without coupling.
namespace subworld {

/// Expected behaviour of a scene.
enum class SceneKind : std::uint8_t {
  structure,  ///< bodies that touch at the start and must not move
  fall,       ///< bodies that start apart, must stay inside and come to rest
};
/// `structure` if the bounds of at least half of the movable bodies touch those of another one, within 1 % of their
/// smallest dimension.
[[nodiscard]] SceneKind kind_of(const Scene& scene);

/// A structure has fallen when a point of one of its bodies may have moved by this share of the body's longest
/// dimension.
inline constexpr double kFallenRatio = 0.5;
/// Two bodies have penetrated completely when a contact is deeper than this share of their smallest dimension: then
/// they may separate on the wrong side.
inline constexpr double kThroughRatio = 0.5;
/// Visible penetration, relative to the smallest dimension of both bodies.
inline constexpr double kVisibleRatio = 0.05;
/// A scene is at rest if the bodies' RMS speed, averaged over the last kRestWindow_s, is at most this share of sqrt(g
/// L), L the longest dimension of a body.
inline constexpr double kRestRatio = 0.01;
inline constexpr double kRestWindow_s = 0.5;
/// The same criteria in words, for pages and help.
extern const char* const kHeldInWords;

/// State after one step.
struct Observed {
  double t_s = 0.0;
  double kinetic_j = 0.0;
  double potential_j = 0.0;  ///< since the start
  double displacement_max_m = 0.0;
  double top_displacement_m = 0.0;  ///< of the body that started highest
  double penetration_max_m = 0.0;
  double penetration_ratio = 0.0;  ///< of the deepest contact, relative to the smallest dimension of both bodies
  std::size_t contacts = 0;
  bool finite = true;
  bool fallen = false;  ///< in a falling scene: a body has left the region
};

/// Watches the bodies of one run.
class Judge {
 public:
  Judge(const Scene& scene, SceneKind kind);
  [[nodiscard]] Observed look(const Engine& engine, double t_s) const;
  /// Whether bodies with this total kinetic energy are at rest.
  [[nodiscard]] bool at_rest(double kinetic_j) const;

 private:
  struct Watched {
    const Body* body;
    BodyState start;
    double longest_m;
    double reach_m;  ///< largest distance of its points from its centre, if it can rotate
  };
  [[nodiscard]] bool lost(const Watched& one, const BodyState& now) const;
  void look_at_contacts(const Engine& engine, Observed& seen) const;

  SceneKind kind_;
  Vec3 gravity_;
  Box arena_;  ///< around everything at the start
  std::vector<Watched> movable_;
  std::vector<double> smallest_m_;  ///< smallest dimension, by body; infinite for a plane
  std::size_t top_ = 0;
  double mass_kg_ = 0.0;
  double longest_m_ = 0.0;
};

}  // namespace subworld
