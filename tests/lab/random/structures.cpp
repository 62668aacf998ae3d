#include "lab/random/structures.hpp"

#include "model/shapes/mass_properties.hpp"
#include "model/trigonometry.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kWidest = 1.3;  ///< largest reach of a body from its centre, relative to the usual size

BodyState at(const Vec3& position, const Quat& orientation = Quat::Identity()) {
  BodyState state;
  state.position = position;
  state.orientation = orientation;
  return state;
}

}  // namespace

double Builder::gap_m() { return draw_.chance(0.6) ? 0.0 : rounded(draw_.factor(1e-5, 1e-2) * ranges_.size_m); }

double Builder::build(Structure structure, double from_x, int most) {
  constexpr double (Builder::*kMakers[])(double, int) = {&Builder::stack,  &Builder::row,  &Builder::heap,
                                                         &Builder::wall,   &Builder::ramp, &Builder::against_wall,
                                                         &Builder::flight, &Builder::lone};
  return (this->*kMakers[static_cast<std::size_t>(structure)])(from_x, most);
}

double Builder::stack(double from_x, int most) {
  const int count = std::min(most, draw_.whole(2, 6));
  const double x = from_x + kWidest * ranges_.size_m;
  double top = 0.0, right = x;
  for (int i = 0; i < count; ++i) {
    const bool last = i + 1 == count;
    const Body body = draw_body(!last);
    const Quat turn = last && draw_.chance(0.5) ? draw_orientation() : draw_yaw();
    const double below = reach_m(scene_, body.shape, turn, -Vec3::UnitZ());
    top += gap_m() + below;
    const BodyId id = add(body, at({x, 0.0, top}, turn), "stack");
    top = bounds_of(scene_, scene_.body(id), scene_.initial[index(id)]).upper.z();
    right = std::max(right, bounds_of(scene_, scene_.body(id), scene_.initial[index(id)]).upper.x());
  }
  return right;
}

double Builder::row(double from_x, int most) {
  const int count = std::min(most, draw_.whole(3, 8));
  double x = from_x;
  for (int i = 0; i < count; ++i) {
    const Body body = draw_body(draw_.chance(0.8));
    const Quat turn = draw_.chance(0.8) ? Quat::Identity() : draw_yaw();
    x += (i > 0 ? gap_m() : 0.0) + reach_m(scene_, body.shape, turn, -Vec3::UnitX());
    const double z = gap_m() + reach_m(scene_, body.shape, turn, -Vec3::UnitZ());
    add(body, at({x, 0.0, z}, turn), "row");
    x += reach_m(scene_, body.shape, turn, Vec3::UnitX());
  }
  return x;
}

double Builder::heap(double from_x, int most) {
  const int count = std::min(most, draw_.whole(4, 12));
  std::vector<Body> bodies;
  double radius = 0.0;
  for (int i = 0; i < count; ++i) {
    bodies.push_back(draw_body());
    const Box box = bounds_of(scene_, bodies.back(), {});
    radius = std::max(radius, box.upper.cwiseMax(-box.lower).norm());
  }
  const double cell = 2.02 * radius;
  const int side = count > 4 ? 2 : 1;
  for (int i = 0; i < count; ++i) {
    const int layer = i / (side * side), column = i % (side * side);
    add(bodies[static_cast<std::size_t>(i)],
        at(rounded(Vec3(from_x + cell * (0.5 + column / side), cell * (0.5 + column % side), cell * (0.5 + layer)), 6),
           draw_orientation()),
        "heap");
  }
  return from_x + side * cell;
}

double Builder::wall(double from_x, int most) {
  Body brick = draw_body(true);
  brick.shape = draw_shape(ShapeKind::box, ranges_.size_m);
  set_mass(brick, brick.mass);
  const int across = std::clamp(most / 3, 1, 3), courses = std::min(most / across, draw_.whole(2, 4));
  const Vec3 half = brick.shape.half_extents;
  const double step = 2.0 * half.x() + gap_m(), rise = 2.0 * half.z() + gap_m();
  for (int course = 0; course < std::max(1, courses); ++course) {
    for (int i = 0; i < across; ++i)
      add(brick, at({from_x + half.x() + (i + 0.5 * (course % 2)) * step, 0.0, half.z() + course * rise}), "brick");
  }
  return from_x + (across + 0.5) * step;
}

double Builder::ramp(double from_x, int most) {
  const double length = 4.0 * ranges_.size_m, thick = 0.2 * ranges_.size_m;
  const Quat tilt = rotation_deg(Vec3::UnitY(), rounded(draw_.between(3.0, 45.0)));
  const Vec3 along = tilt * Vec3::UnitX(), up = tilt * Vec3::UnitZ();
  const double low = along.cwiseAbs().z() * length + up.z() * thick;
  const Vec3 centre(from_x + length, 0.0, 1.01 * low);
  add_fixed({.kind = ShapeKind::box, .half_extents = {length, 1.5 * ranges_.size_m, thick}}, {centre, tilt}, "ramp");
  const int count = std::min(most, draw_.whole(1, 4));
  double s = -0.9 * length;
  for (int i = 0; i < count; ++i) {
    const Body body = draw_body(draw_.chance(0.6));
    const Quat turn = draw_.chance(0.6) ? tilt : Quat(tilt * draw_orientation());
    s += reach_m(scene_, body.shape, turn, -along);
    const double above = thick + gap_m() + reach_m(scene_, body.shape, turn, -up);
    if (s + reach_m(scene_, body.shape, turn, along) > 0.95 * length) break;
    add(body, at(centre + s * along + above * up, turn), "slider");
    s += reach_m(scene_, body.shape, turn, along) + gap_m() + 0.02 * ranges_.size_m;
  }
  return from_x + 2.0 * (length + ranges_.size_m);
}

/// Bodies that touch a fixed wall without support below, or stand at it.
double Builder::against_wall(double from_x, int most) {
  const double half = 0.25 * ranges_.size_m, high = 3.0 * ranges_.size_m;
  double x = from_x;
  const int count = std::min(most, draw_.whole(1, 3));
  double z = 0.0;
  for (int i = 0; i < count; ++i) {
    Body body = draw_body(true);
    if (draw_.chance(0.3)) body.gravity = false;
    const Quat turn = draw_.chance(0.7) ? Quat::Identity() : draw_yaw();
    z += reach_m(scene_, body.shape, turn, -Vec3::UnitZ()) + (i > 0 || draw_.chance(0.5) ? gap_m() : 0.5 * high);
    const double before = reach_m(scene_, body.shape, turn, Vec3::UnitX());
    add(body, at({x + 2.0 * kWidest * ranges_.size_m - before, 0.0, z}, turn), "hanging");
    z += reach_m(scene_, body.shape, turn, Vec3::UnitZ());
  }
  x += 2.0 * kWidest * ranges_.size_m;
  add_fixed({.kind = ShapeKind::box, .half_extents = {half, high, high}}, {{x + half, 0.0, high}, Quat::Identity()},
            "upright");
  return x + 2.0 * half;
}

double Builder::flight(double from_x, int most) {
  const int count = std::min(most, draw_.whole(1, 4));
  const double cell = 2.0 * kWidest * ranges_.size_m;
  for (int i = 0; i < count; ++i) {
    Body body = draw_body();
    BodyState state = at({from_x + cell * (0.5 + i % 2), 0.0, cell * (0.6 + i / 2)}, draw_orientation());
    push(body, state);
    add(body, state, "flying");
  }
  return from_x + 2.0 * cell;
}

double Builder::lone(double from_x, int) {
  const Body body = draw_body();
  const Quat turn = draw_orientation();
  const double x = from_x + reach_m(scene_, body.shape, turn, -Vec3::UnitX());
  BodyState state = at({x, 0.0, gap_m() + reach_m(scene_, body.shape, turn, -Vec3::UnitZ())}, turn);
  state.position.z() += draw_.chance(0.3) ? ranges_.size_m : 0.0;
  add(body, state, "lone");
  return x + reach_m(scene_, body.shape, turn, Vec3::UnitX());
}

void Builder::push(Body& body, BodyState& state) {
  state.linear_velocity = rounded(Vec3(draw_.factor(0.05, 3.0) * draw_.direction()));
  if (body.rotates && draw_.chance(0.6))
    state.angular_velocity = rounded(Vec3(draw_.factor(0.5, 30.0) * draw_.direction()));
}

}  // namespace subworld
