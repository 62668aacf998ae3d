#pragma once

#include "lab/session/draw.hpp"
#include "model/scene/scene.hpp"

#include <array>
#include <string>

/// Random structures of bodies, for scenes of any lab.
namespace subworld {

enum class Structure : std::uint8_t { stack, row, heap, wall, ramp, against_wall, flight, lone };
inline constexpr std::array kStructureNames{"stack", "row", "heap", "wall", "ramp", "against_wall", "flight", "lone"};

/// Ranges of the random properties of bodies.
struct BodyRanges {
  double least_size_m = 0.005, most_size_m = 0.5;  ///< of a side or diameter
  double least_mass_kg = 1e-3, most_mass_kg = 10.0;
  double size_m = 0.1;  ///< usual in this scene
  double mass_kg = 0.3;
  double mass_spread = 3.0;  ///< factor around it
  std::vector<Material> materials{{}};
};

/// Extent of a shape from its centre along a unit direction, m. Not for planes.
[[nodiscard]] double reach_m(const Scene& scene, const Shape& shape, const Quat& orientation, const Vec3& direction);
[[nodiscard]] Box bounds_of(const Scene& scene, const Body& body, const BodyState& state);

/// Adds bodies to a scene, without overlap.
class Builder {
 public:
  Builder(Scene& scene, Draw& draw, BodyRanges ranges) : scene_(scene), draw_(draw), ranges_(std::move(ranges)) {}

  BodyId add(Body body, const BodyState& state, const std::string& name);
  BodyId add_fixed(const Shape& shape, const Pose& pose, const std::string& name);
  /// The ground: its highest point is z = 0.
  void add_floor(double half_m);
  /// Adds at least one body, and at most `most`, on z = 0 and with all points at x >= `from_x`. Returns its end in x.
  double build(Structure structure, double from_x, int most);

  /// A movable body of any shape; `flat`: with a flat top that can carry another body.
  [[nodiscard]] Body draw_body(bool flat = false);
  [[nodiscard]] Shape draw_shape(ShapeKind kind, double size_m);
  [[nodiscard]] Material draw_material();
  [[nodiscard]] Quat draw_orientation();
  [[nodiscard]] Quat draw_yaw();
  void set_mass(Body& body, double mass_kg) const;

 private:
  double stack(double from_x, int most);
  double row(double from_x, int most);
  double heap(double from_x, int most);
  double wall(double from_x, int most);
  double ramp(double from_x, int most);
  double against_wall(double from_x, int most);
  double flight(double from_x, int most);
  double lone(double from_x, int most);
  [[nodiscard]] std::uint32_t add_hull(double size_m);
  /// Distance of two touching bodies: often zero.
  [[nodiscard]] double gap_m();
  void push(Body& body, BodyState& state);

  Scene& scene_;
  Draw& draw_;
  BodyRanges ranges_;
  int made_ = 0;
};

}  // namespace subworld
