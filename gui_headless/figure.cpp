#include "figure.hpp"

#include "impulse_lines.hpp"
#include "model/shape_extent.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace subworld {
namespace {

constexpr double kFarthest_m = 1e7;  // farther bodies are not shown: floats are not precise enough

enum class Role : std::uint8_t { other, member, border, proxy };

using Roles = std::unordered_map<std::uint32_t, Role>;

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
      return kProxyColour;
    case Role::border:
      return kBorderColour;
    case Role::member:
      return kMemberColour;
    case Role::other:
      break;
  }
  return item.body->fixed() ? kFixedColour : kOtherColour;
}

Model model_of(const Shape& shape) {
  switch (shape.kind) {
    case ShapeKind::sphere:
      return Model::sphere;
    case ShapeKind::capsule:
      return Model::capsule;
    case ShapeKind::cylinder:
      return Model::cylinder;
    case ShapeKind::convex:
    case ShapeKind::mesh:
      return static_cast<Model>(static_cast<std::uint32_t>(Model::file) + shape.mesh);
    case ShapeKind::box:
    case ShapeKind::plane:
      break;
  }
  return Model::box;
}

Instance instance_of(const Item& item, const Vec3& origin) {
  const Shape& shape = item.body->shape;
  Instance instance;
  Eigen::Map<Eigen::Vector3f>(instance.position.data()) = (item.state->position - origin).cast<float>();
  Eigen::Map<Eigen::Vector4f>(instance.orientation.data()) =
      item.state->orientation.normalized().coeffs().cast<float>();
  Vec3 scale = Vec3::Ones();
  if (shape.kind == ShapeKind::box) scale = shape.half_extents;
  if (shape.kind == ShapeKind::sphere || shape.kind == ShapeKind::capsule) scale *= shape.radius;
  if (shape.kind == ShapeKind::cylinder) scale = {shape.radius, shape.radius, shape.half_length};
  if (shape.kind == ShapeKind::capsule) instance.half_length = static_cast<float>(shape.half_length);
  Eigen::Map<Eigen::Vector3f>(instance.scale.data()) = scale.cast<float>();
  instance.colour = colour_of(item);
  return instance;
}

Ground ground_of(const Item& item, const Vec3& origin) {
  const Quat orientation = item.state->orientation.normalized();
  const Vec3 local = orientation.conjugate() * (origin - item.state->position);
  const Vec3 below(local.x(), local.y(), 0.0);
  return {item.state->position + orientation * below - origin, orientation, local.head<2>()};
}

void place(const std::vector<Item>& items, Figure& figure) {
  for (const auto& item : items) {
    const ShapeKind kind = item.body->shape.kind;
    if (kind == ShapeKind::plane) {
      figure.grounds.push_back(ground_of(item, figure.origin));
      continue;
    }
    const bool glass = item.body->fixed() && kind == ShapeKind::box && item.role == Role::other;
    Batch& batch = glass                       ? figure.glass
                   : item.role == Role::proxy  ? figure.proxies
                   : item.role >= Role::member ? figure.members
                                               : figure.others;
    batch[model_of(item.body->shape)].push_back(instance_of(item, figure.origin));
  }
}

}  // namespace

bool pushes_member(const UserView& user, const BoundaryContact& pair) {
  return std::ranges::find(user.members, pair.inside) != user.members.end();
}

Figure compose(const Picture& picture, PictureSize size) {
  const auto items = items_of(picture);
  const auto movable = without_strays(items);
  const auto visible = framed(items, movable);
  Figure figure;
  figure.movable = enclosing_ball(visible);
  const Vec3 focus = mean_proxy(items, figure.movable.centre);
  figure.camera =
      picture.camera ? *picture.camera : fit_camera(visible, focus, static_cast<double>(size.width) / size.height);
  figure.origin = figure.movable.centre;
  figure.omitted = picture.bodies.size() - items.size();
  figure.grid_m = std::pow(10.0, std::round(std::log10(std::max(1e-6, figure.movable.radius / 4.0))));
  place(items, figure);
  add_impulse_lines(picture, size, figure);
  return figure;
}

}  // namespace subworld
