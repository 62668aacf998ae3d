#pragma once

#include "model/scene.hpp"
#include "physics/engine.hpp"

#include <vector>

/// What an engine alone is judged by.
namespace subworld {

/// What a scene asks of an engine.
enum class SceneKind : std::uint8_t {
  structure,  ///< bodies that touch at the start: they shall stay where they are
  fall,       ///< bodies that start apart: they shall stay inside and come to lie
};
/// A structure where at least half of the movable bodies have, within 1 % of their smallest dimension, the bounds of
/// another one.
[[nodiscard]] SceneKind kind_of(const Scene& scene);

/// A structure has fallen when a point of one of its bodies may be farther from its start than this part of the body's
/// longest dimension.
inline constexpr double kFallenRatio = 0.5;
/// Bodies are through each other when a contact is deeper than this part of the smallest dimension of both: from there
/// on the way out may be on the wrong side.
inline constexpr double kThroughRatio = 0.5;
/// Penetration that is seen, of the smallest dimension of both.
inline constexpr double kVisibleRatio = 0.05;
/// At rest: the bodies' RMS speed is at most this part of sqrt(g L), L the longest dimension of a body, in the mean of
/// the last kRestWindow_s.
inline constexpr double kRestRatio = 0.01;
inline constexpr double kRestWindow_s = 0.5;
/// The same in words, for pages and help.
extern const char* const kHeldInWords;

/// After one step.
struct Observed {
  double t_s = 0.0;
  double kinetic_j = 0.0;
  double potential_j = 0.0;  ///< since the start
  double displacement_max_m = 0.0;
  double top_displacement_m = 0.0;  ///< of the body that started highest
  double penetration_max_m = 0.0;
  double penetration_ratio = 0.0;  ///< the deepest, of the smallest dimension of both bodies
  std::size_t contacts = 0;
  bool finite = true;
  bool fallen = false;  ///< or left, in a scene that falls
};

/// Watches the bodies of one run.
class Judge {
 public:
  Judge(const Scene& scene, SceneKind kind);
  [[nodiscard]] Observed look(const Engine& engine, double t_s) const;
  /// Whether bodies with that kinetic energy in all are at rest.
  [[nodiscard]] bool at_rest(double kinetic_j) const;

 private:
  struct Watched {
    const Body* body;
    BodyState start;
    double longest_m;
    double reach_m;  ///< of its points from its centre, where they can turn
  };
  [[nodiscard]] bool lost(const Watched& one, const BodyState& now) const;
  void look_at_contacts(const Engine& engine, Observed& seen) const;

  SceneKind kind_;
  Vec3 gravity_;
  Box arena_;  ///< around everything at the start
  std::vector<Watched> movable_;
  std::vector<double> smallest_m_;  ///< dimension, by body; infinite for a plane
  std::size_t top_ = 0;
  double mass_kg_ = 0.0;
  double longest_m_ = 0.0;
};

}  // namespace subworld
