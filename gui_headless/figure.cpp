#include "figure.hpp"

#include "joint_marks.hpp"
#include "model/shapes/shape_extent.hpp"
#include "model/trigonometry.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

namespace subworld {
namespace {

constexpr double kFarthest_m = 1e7;  // farther bodies are not shown: floats are not precise enough

enum class Role : std::uint8_t { other, member, border, proxy };

using Roles = std::unordered_map<std::uint32_t, Role>;

/// Whether the inside body of the pair is a member. At a contact that may come soon it may be a ghost.
bool pushes_member(const UserView& user, const BoundaryContact& pair) {
  return std::ranges::find(user.members, pair.inside) != user.members.end();
}

Roles roles_of(std::span<const UserView> users) {
  Roles roles;
  const auto raise = [&](BodyId id, Role role) {
    auto& known = roles[index(id)];
    known = std::max(known, role);
  };
  for (const auto& user : users) {
    raise(user.proxy, Role::proxy);
    for (const auto member : user.members) raise(member, Role::member);
    for (const auto& pair : user.border) {
      if (pushes_member(user, pair)) raise(pair.inside, Role::border);
    }
  }
  return roles;
}

// A body to draw.
struct Item {
  const Body* body;
  const BodyState* state;
  double radius;
  Role role;
};

bool drawable(const BodyState& state, double radius) {
  return finite(state) && state.position.norm() < kFarthest_m && state.orientation.norm() > 1e-6 && radius > 0.0 &&
         !std::isnan(radius);
}

std::vector<Item> items_of(const Picture& picture) {
  const auto roles = roles_of(picture.users);
  std::vector<Item> items;
  items.reserve(picture.bodies.size());
  for (std::size_t i = 0; i < std::min(picture.bodies.size(), picture.states.size()); ++i) {
    const Body& body = picture.bodies[i];
    const double radius = bounding_radius(body.shape, picture.meshes);
    if (!drawable(picture.states[i], radius)) continue;
    const auto role = roles.find(index(body.id));
    items.push_back({&body, &picture.states[i], radius, role == roles.end() ? Role::other : role->second});
  }
  return items;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The movable bodies without those that were thrown far out of the scene. Includes proxies always.
std::vector<Ball> without_strays(const std::vector<Item>& items) {
  std::vector<const Item*> movable;
  for (const auto& item : items) {
    if (!item.body->fixed() || item.role == Role::proxy) movable.push_back(&item);
  }
  if (movable.empty()) return {};
  Vec3 middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const auto* item : movable) values.push_back(item->state->position[axis]);
    middle[axis] = median(std::move(values));
  }
  std::vector<double> distances;
  for (const auto* item : movable) distances.push_back((item->state->position - middle).norm() + item->radius);
  auto sorted = distances;
  std::ranges::sort(sorted);
  const double reach = 5.0 * sorted[3 * sorted.size() / 4];
  std::vector<Ball> balls;
  for (std::size_t i = 0; i < movable.size(); ++i) {
    if (distances[i] > reach && movable[i]->role != Role::proxy) continue;
    balls.push_back({movable[i]->state->position, movable[i]->radius});
  }
  return balls;
}

void add_corners(const Item& item, std::vector<Ball>& balls) {
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 sign((corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0, (corner & 4) != 0 ? 1.0 : -1.0);
    const Vec3 arm = item.state->orientation.normalized() * sign.cwiseProduct(item.body->shape.half_extents);
    balls.push_back({item.state->position + arm, 0.0});
  }
}

// Objects that must be in the picture: the movable bodies, and fixed ones (the bin around them) that are not much
// larger.
std::vector<Ball> framed(const std::vector<Item>& items, const std::vector<Ball>& movable) {
  std::vector<Ball> balls = movable;
  const Ball all = enclosing_ball(movable);
  for (const auto& item : items) {
    if (!item.body->fixed() || !std::isfinite(item.radius)) continue;
    const double reach = (item.state->position - all.centre).norm() + item.radius;
    if (!movable.empty() && reach > 2.2 * all.radius) continue;
    if (item.body->shape.kind == ShapeKind::box) {
      add_corners(item, balls);
    } else {
      balls.push_back({item.state->position, item.radius});
    }
  }
  return balls;
}

Vec3 mean_proxy(const std::vector<Item>& items, const Vec3& otherwise) {
  Vec3 sum = Vec3::Zero();
  double count = 0.0;
  for (const auto& item : items) {
    if (item.role != Role::proxy) continue;
    sum += item.state->position;
    count += 1.0;
  }
  return count > 0.0 ? Vec3(sum / count) : otherwise;
}

Colour colour_of(const Item& item) {
  switch (item.role) {
    case Role::proxy:
      return {0.86F, 0.12F, 0.10F};
    case Role::border:
      return {0.98F, 0.77F, 0.08F};
    case Role::member:
      return {0.16F, 0.42F, 0.84F};
    case Role::other:
      break;
  }
  return item.body->fixed() ? Colour(0.66F, 0.71F, 0.76F) : Colour(0.85F, 0.86F, 0.87F);
}

Solid::Layer layer_of(const Item& item) {
  if (item.role == Role::proxy) return Solid::Layer::proxy;
  if (item.role != Role::other) return Solid::Layer::member;
  return item.body->fixed() && item.body->shape.kind == ShapeKind::box ? Solid::Layer::glass : Solid::Layer::other;
}

/// Triangles without area, with invalid indices or with non-finite vertices are omitted.
void add_triangles(const Mesh& mesh, const Solid& body, std::vector<Solid>& solids) {
  for (const auto& corners : mesh.triangles) {
    const auto valid = [&](std::uint32_t v) { return v < mesh.vertices.size() && mesh.vertices[v].allFinite(); };
    if (!std::ranges::all_of(corners, valid)) continue;
    Eigen::Matrix3f at;
    for (int i = 0; i < 3; ++i)
      at.col(i) = body.turn * mesh.vertices[corners[static_cast<std::size_t>(i)]].cast<float>();
    const Eigen::Vector3f middle = at.rowwise().mean();
    if (!((at.col(1) - at.col(0)).cross(at.col(2) - at.col(0)).squaredNorm() > 0.0F)) continue;
    Solid& one = solids.emplace_back(body);
    one.form = Solid::Form::triangle;
    one.turn.setIdentity();
    one.centre += middle;
    one.radius = (at.colwise() - middle).colwise().norm().maxCoeff();
    one.triangle << at.col(0) - middle, at.col(1) - at.col(0), at.col(2) - at.col(0);
  }
}

void add_solid(const Item& item, std::span<const Mesh> meshes, Figure& figure) {
  const Shape& shape = item.body->shape;
  const auto radius = static_cast<float>(shape.radius), half = static_cast<float>(shape.half_length);
  Solid solid{.layer = layer_of(item),
              .centre = (item.state->position - figure.origin).cast<float>(),
              .turn = item.state->orientation.normalized().toRotationMatrix().cast<float>(),
              .size = shape.half_extents.cast<float>(),
              .radius = static_cast<float>(item.radius),
              .colour = colour_of(item)};
  if (shape.kind >= ShapeKind::convex) return add_triangles(meshes[shape.mesh], solid, figure.solids);
  if (shape.kind == ShapeKind::cylinder) {
    solid.form = Solid::Form::frustum;
    solid.size = {radius, radius, half};
  } else if (shape.kind != ShapeKind::box) {
    solid.form = Solid::Form::capsule;
    solid.size = {radius, shape.kind == ShapeKind::capsule ? half : 0.0F, 0.0F};
  }
  figure.solids.push_back(solid);
}

Ground ground_of(const Item& item, const Vec3& origin) {
  const Quat orientation = item.state->orientation.normalized();
  const Vec3 local = orientation.conjugate() * (origin - item.state->position);
  const Vec3 at = item.state->position + orientation * Vec3(local.x(), local.y(), 0.0) - origin;
  return {at.cast<float>(), orientation.toRotationMatrix().cast<float>(), local.head<2>()};
}

/// A border body's impulse: the sum of the border impulses on it.
struct Line {
  Vec3 from;
  Vec3 impulse;
  double body_radius;
};

std::unordered_map<std::uint32_t, const Item*> by_id(const std::vector<Item>& items) {
  std::unordered_map<std::uint32_t, const Item*> drawn;
  for (const Item& item : items) drawn.emplace(index(item.body->id), &item);
  return drawn;
}

std::vector<Line> lines_of(const Picture& picture, const std::vector<Item>& items) {
  const auto drawn = by_id(items);
  std::vector<Line> lines;
  for (const auto& user : picture.users) {
    std::map<std::uint32_t, Vec3> sums;
    for (const auto& pair : user.border) {
      if (!pushes_member(user, pair)) continue;
      const Vec3 impulse = pair.normal * pair.normal_impulse + pair.tangential_impulse;
      if (impulse.allFinite()) sums.try_emplace(index(pair.inside), Vec3::Zero()).first->second += impulse;
    }
    for (const auto& [id, sum] : sums) {
      if (const auto found = drawn.find(id); found != drawn.end())
        lines.push_back({found->second->state->position, sum, found->second->radius});
    }
  }
  return lines;
}

/// The largest line is a little longer than the bodies at its start, but neither tiny in the picture nor as long as it.
double scale_of(const std::vector<Line>& lines, double picture_height_m) {
  double largest = 0.0, radius = 0.0;
  for (const auto& line : lines) {
    largest = std::max(largest, line.impulse.norm());
    radius += line.body_radius / static_cast<double>(lines.size());
  }
  if (!(largest > 0.0)) return 0.0;
  return std::clamp(3.0 * radius, 0.10 * picture_height_m, 0.25 * picture_height_m) / largest;
}

/// A dot, a shaft and a head; `rim` is the width that an outline adds.
void add_arrow(const Line& line, const Vec3& from, double length, double radius, double rim, Figure& figure) {
  const Vec3 along = line.impulse.normalized();
  const double head = std::min(7.0 * radius, 0.6 * length), shaft = length - head;
  const auto rod = [&](double from_m, double to_m, double lower, double upper) {
    const double half = 0.5 * (to_m - from_m);
    figure.solids.push_back({.form = Solid::Form::frustum,
                             .layer = rim > 0.0 ? Solid::Layer::outline : Solid::Layer::line,
                             .centre = (from + along * (from_m + half)).cast<float>(),
                             .turn = turn_of_z(along).toRotationMatrix().cast<float>(),
                             .size = Vec3(lower, upper, half).cast<float>(),
                             .radius = static_cast<float>(std::hypot(std::max(lower, upper), half)),
                             .colour = {0.80F, 0.02F, 0.06F}});
  };
  rod(-rim, shaft + rim, radius + rim, radius + rim);
  // An outline of constant width around the head needs a longer cone than the head itself.
  rod(shaft - rim, length + 2.5 * rim, head * 0.36 + 1.4 * rim, 0.0);
  rod(0.0, 0.0, 0.0, 0.0);
  Solid& dot = figure.solids.back();
  dot.form = Solid::Form::capsule;
  dot.radius = static_cast<float>(1.5 * radius + rim);
  dot.size = {dot.radius, 0.0F, 0.0F};
}

/// One line for every border body of every user, from its centre along the sum of the border impulses on it (paper,
/// figure 13). Needs the figure's camera and origin.
void add_impulse_lines(const Picture& picture, const std::vector<Item>& items, PictureSize size, Figure& figure) {
  constexpr double kLinePixels = 4.5;      // thickness in a picture of 720 rows
  constexpr double kRimShare = 0.8;        // white outline on each side, relative to half the thickness
  constexpr double kThickestShare = 0.09;  // half the thickness, of the body's radius: small bodies stay visible
  constexpr double kSmallestShare = 0.04;  // of the largest impulse; smaller ones are not drawn
  const auto lines = lines_of(picture, items);
  const Camera& camera = figure.camera;
  const auto middle = project(camera, size.width, size.height, camera.target);
  const double scale =
      picture.line_m_per_n_s.value_or(scale_of(lines, middle ? middle->metres_per_pixel * size.height : 1.0));
  double largest = 0.0;
  for (const auto& line : lines) largest = std::max(largest, line.impulse.norm());
  for (const auto& line : lines) {
    const auto seen = project(camera, size.width, size.height, line.from);
    const double length = line.impulse.norm() * scale;
    if (!seen || !(line.impulse.norm() > kSmallestShare * largest) || !(length > 0.0)) continue;
    const double thickness = kLinePixels * seen->metres_per_pixel * std::max(1.0, size.height / 720.0);
    const double radius = std::min(thickness / 2.0, kThickestShare * line.body_radius);
    for (const double rim : {0.0, kRimShare * radius})
      add_arrow(line, line.from - figure.origin, length, radius, rim, figure);
  }
  figure.line_m_per_n_s = lines.empty() ? 0.0 : scale;
}

/// In front of all bodies, with a white outline. Needs the figure's camera and origin.
void add_joints(const Picture& picture, const std::vector<Item>& items, PictureSize size, Figure& figure) {
  constexpr double kLeastPixels = 1.5;  // radius of a mark, and width of its outline, in a picture of 720 rows
  const auto drawn = by_id(items);
  for (const JointMark& mark : joint_marks(picture.joints, picture.bodies, picture.meshes, picture.broken_joints)) {
    const auto at = drawn.find(index(mark.at)), along = drawn.find(index(mark.along));
    if (at == drawn.end() || along == drawn.end()) continue;
    const Pose place = place_of(mark, *at->second->state, *along->second->state);
    const auto seen = project(figure.camera, size.width, size.height, place.position);
    if (!seen) continue;
    const double least = kLeastPixels * seen->metres_per_pixel * std::max(1.0, size.height / 720.0);
    for (const double rim : {0.0, least}) {
      const double radius = std::max(mark.radius, least) + rim, half = mark.half_length + rim;
      const bool is_rod = mark.form == JointMark::Form::rod, is_cube = mark.form == JointMark::Form::cube;
      Solid solid{.form = is_rod    ? Solid::Form::frustum
                          : is_cube ? Solid::Form::box
                                    : Solid::Form::capsule,
                  .layer = rim > 0.0 ? Solid::Layer::outline : Solid::Layer::line,
                  .centre = (place.position - figure.origin).cast<float>(),
                  .turn = place.orientation.toRotationMatrix().cast<float>(),
                  .size = Vec3(radius, is_rod || is_cube ? radius : 0.0, is_rod ? half : radius).cast<float>(),
                  .radius = static_cast<float>(std::sqrt(2.0 * radius * radius + half * half)),
                  .colour = Colour(kJointColour.data())};
      figure.solids.push_back(solid);
    }
  }
}

}  // namespace

Camera automatic_camera(const Picture& picture, PictureSize size) {
  const auto items = items_of(picture);
  const auto visible = framed(items, without_strays(items));
  const Vec3 focus = mean_proxy(items, enclosing_ball(visible).centre);
  return fit_camera(visible, focus, static_cast<double>(size.width) / size.height);
}

Figure compose(const Picture& picture, PictureSize size) {
  const auto items = items_of(picture);
  Figure figure;
  figure.movable = enclosing_ball(framed(items, without_strays(items)));
  figure.camera = picture.camera ? *picture.camera : automatic_camera(picture, size);
  figure.origin = figure.movable.centre;
  figure.omitted = picture.bodies.size() - items.size();
  figure.grid_m = std::pow(10.0, std::round(std::log10(std::max(1e-6, figure.movable.radius / 4.0))));
  for (const Item& item : items) {
    if (item.body->shape.kind == ShapeKind::plane) {
      figure.grounds.push_back(ground_of(item, figure.origin));
    } else {
      add_solid(item, picture.meshes, figure);
    }
  }
  add_impulse_lines(picture, items, size, figure);
  add_joints(picture, items, size, figure);
  return figure;
}

}  // namespace subworld
