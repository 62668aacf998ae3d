#include "impulse_lines.hpp"

#include "model/shape_extent.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

namespace subworld {
namespace {

constexpr double kLinePixels = 4.5;  // thickness in a picture of 720 rows
constexpr double kRimShare = 0.8;    // white outline on each side, relative to half the thickness
// Half the thickness, relative to the body's radius, so that many small bodies stay visible.
constexpr double kThickestShare = 0.09;
constexpr double kSmallestShare = 0.04;  // relative to the largest impulse; smaller ones are not drawn

struct Line {
  Vec3 from;
  Vec3 impulse;
  double body_radius;
};

std::vector<Line> lines_of(const Picture& picture) {
  std::unordered_map<std::uint32_t, std::size_t> place;
  for (std::size_t i = 0; i < std::min(picture.bodies.size(), picture.states.size()); ++i) {
    if (finite(picture.states[i])) place.emplace(index(picture.bodies[i].id), i);
  }
  std::vector<Line> lines;
  for (const auto& user : picture.users) {
    std::map<std::uint32_t, Vec3> sums;
    for (const auto& pair : user.border) {
      if (!pushes_member(user, pair)) continue;
      const Vec3 impulse = pair.normal * pair.normal_impulse + pair.tangential_impulse;
      if (impulse.allFinite()) sums.try_emplace(index(pair.inside), Vec3::Zero()).first->second += impulse;
    }
    for (const auto& [id, sum] : sums) {
      const auto found = place.find(id);
      if (found == place.end()) continue;
      const auto& shape = picture.bodies[found->second].shape;
      lines.push_back({picture.states[found->second].position, sum, bounding_radius(shape, picture.meshes)});
    }
  }
  return lines;
}

// The largest line is a little longer than the bodies at its start, but neither tiny in the picture nor as long as it.
double scale_of(const std::vector<Line>& lines, double picture_height_m) {
  double largest = 0.0;
  double radius = 0.0;
  for (const auto& line : lines) {
    largest = std::max(largest, line.impulse.norm());
    radius += line.body_radius / static_cast<double>(lines.size());
  }
  if (!(largest > 0.0)) return 0.0;
  return std::clamp(3.0 * radius, 0.10 * picture_height_m, 0.25 * picture_height_m) / largest;
}

/// The shortest turn of z to a unit vector. Quat::FromTwoVectors compiles a singular value decomposition for the one
/// case of opposite vectors.
Quat turn_of_z(const Vec3& to) {
  const double twice_w = std::sqrt(2.0 * (1.0 + to.z()));
  if (!(twice_w > 1e-6)) return Quat(0.0, 1.0, 0.0, 0.0);
  return Quat(0.5 * twice_w, -to.y() / twice_w, to.x() / twice_w, 0.0);
}

Instance rod(Vec3 from, const Vec3& along, double length, double radius, const Colour& colour) {
  Instance instance;
  Eigen::Map<Eigen::Vector3f>(instance.position.data()) = from.cast<float>();
  const Quat turn = turn_of_z(along);
  Eigen::Map<Eigen::Vector4f>(instance.orientation.data()) = turn.coeffs().cast<float>();
  instance.scale = {static_cast<float>(radius), static_cast<float>(radius), static_cast<float>(length)};
  instance.colour = colour;
  return instance;
}

// A shaft and a head; `rim` is the width that an outline adds.
void add_arrow(const Vec3& from, const Vec3& impulse, double length, double radius, double rim, const Colour& colour,
               Batch& batch) {
  const Vec3 along = impulse.normalized();
  const double head = std::min(7.0 * radius, 0.6 * length);
  const double shaft = length - head;
  batch[Model::cylinder].push_back(rod(from + along * (shaft / 2.0), along, shaft / 2.0 + rim, radius + rim, colour));
  // An outline of constant width around the head needs a longer cone than the head itself.
  batch[Model::cone].push_back(
      rod(from + along * (shaft - rim), along, head + 3.5 * rim, head * 0.36 + 1.4 * rim, colour));
  Instance dot = rod(from, along, 1.5 * radius + rim, 1.5 * radius + rim, colour);
  batch[Model::sphere].push_back(dot);
}

}  // namespace

void add_impulse_lines(const Picture& picture, PictureSize size, Figure& figure) {
  const auto lines = lines_of(picture);
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
    const Vec3 from = line.from - figure.origin;
    add_arrow(from, line.impulse, length, radius, 0.0, kLineColour, figure.lines);
    add_arrow(from, line.impulse, length, radius, kRimShare * radius, {1.0F, 1.0F, 1.0F}, figure.halos);
  }
  figure.line_m_per_n_s = lines.empty() ? 0.0 : scale;
}

}  // namespace subworld
