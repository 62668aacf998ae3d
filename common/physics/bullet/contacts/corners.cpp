#include "physics/bullet/contacts/corners.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace subworld::bullet {

namespace {

constexpr int kDiscCorners = 8;  ///< of a touching cap
/// Of the face that represents a touched cap: at most half a percent larger than the disc.
constexpr int kDiscSides = 32;
constexpr double kCap = 0.7;  ///< least cosine between axis and normal at which a cylinder touches with its cap
constexpr std::uint32_t kMostFaceCorners = 24;  ///< of a face with more, this many corners around it are used

/// Corners of a cap. The first is the lowest along `down` if the tilt is larger than noise.
void add_disc(const Placed& s, const Vec3& down, double fine, Corners& out) {
  const Vec3 axis = s.turn.col(2), cap = std::copysign(1.0, axis.dot(down)) * axis;
  const Vec3 lean = down - down.dot(cap) * cap;
  const double drop = s.shape.disc_radius * lean.norm();  // height of the rim below the centre
  const bool tilted = 0.08 * drop > fine;                 // 1 - cos(half a corner's angle)
  const Vec3 u = tilted ? Vec3(lean.normalized()) : across(cap);
  const Vec3 v = cap.cross(u);
  const Vec3 middle = s.at + s.shape.half_length * cap;
  for (int i = 0; i < kDiscCorners; ++i) {
    const double angle = 2.0 * M_PI * i / kDiscCorners;
    const double x = s.shape.disc_radius * std::cos(angle), y = s.shape.disc_radius * std::sin(angle);
    out.add({middle + x * u + y * v, i, i});
  }
}

/// The side line of a cylinder that faces down.
void add_side(const Placed& s, const Vec3& down, Corners& out) {
  const Vec3 axis = s.turn.col(2);
  const Vec3 lean = down - down.dot(axis) * axis;
  const Vec3 rim = s.shape.disc_radius * lean.normalized();
  out.add({s.at + rim - s.shape.half_length * axis, 0, 0});
  out.add({s.at + rim + s.shape.half_length * axis, 1, 1});
}

void add_segment(const Placed& s, const Vec3& down, Corners& out) {
  const Vec3 half = s.shape.half_length * s.turn.col(2), rim = s.shape.radius * down;
  out.add({s.at + rim - half, 0, 0});
  out.add({s.at + rim + half, 1, 1});
}

void add_face(const Placed& s, std::uint32_t number, Corners& out) {
  const ConvexFace& face = s.shape.faces[number];
  const std::uint32_t count = std::min(face.corners, kMostFaceCorners);
  for (std::uint32_t k = 0; k < count; ++k) {
    const std::uint32_t vertex = s.shape.rings[face.first + k * face.corners / count];
    const int name = static_cast<int>(vertex % 32);
    out.add({s.vertex(vertex), name, name});
  }
}

}  // namespace

void Corners::cut(const Vec3& outwards, double offset, int number) {
  std::array<double, kMostCorners> out;
  bool any = false;
  for (std::size_t i = 0; i < count_; ++i) {
    out[i] = outwards.dot(corners_[i].point) - offset;
    any = any || out[i] > 0.0;
  }
  if (!any) return;
  const Corners whole = *this;
  const bool closed = whole.count_ > 2;
  clear();
  for (std::size_t i = 0; i < whole.count_; ++i) {
    if (out[i] <= 0.0) add(whole[i]);
    const std::size_t next = i + 1 < whole.count_ ? i + 1 : 0;
    if ((next == 0 && !closed) || (out[i] <= 0.0) == (out[next] <= 0.0)) continue;
    const double part = out[i] / (out[i] - out[next]);
    add({whole[i].point + part * (whole[next].point - whole[i].point), 64 * (1 + number) + whole[i].edge,
         out[i] <= 0.0 ? 64 * (1 + number) : whole[i].edge});
  }
}

Vec3 across(const Vec3& direction) {
  const Vec3 axis = std::abs(direction.x()) < 0.7 ? Vec3::UnitX() : Vec3::UnitY();
  return direction.cross(axis).normalized();
}

std::uint32_t face_at(const Placed& s, std::uint32_t vertex, const Vec3& down) {
  const Vec3 local = s.turn.transpose() * down;
  std::uint32_t best = 0;
  double most = -2.0;
  for (std::uint32_t i = s.shape.first_of[vertex]; i < s.shape.first_of[vertex + 1]; ++i) {
    const double along = s.shape.faces[s.shape.faces_of[i]].normal.dot(local);
    if (along <= most) continue;
    most = along;
    best = s.shape.faces_of[i];
  }
  return best;
}

void add_lowest(const Placed& s, const Vec3& down, double fine, Corners& out) {
  switch (s.shape.core) {
    case Convex::Core::point:
      return out.add({s.at + s.shape.radius * down, 0, 0});
    case Convex::Core::segment:
      return add_segment(s, down, out);
    case Convex::Core::cylinder:
      if (std::abs(s.turn.col(2).dot(down)) > kCap) return add_disc(s, down, fine, out);
      return add_side(s, down, out);
    case Convex::Core::polyhedron: {
      const std::uint32_t vertex = s.shape.farthest(s.turn.transpose() * down);
      if (s.shape.faces.empty()) return add_face(s, 0, out);
      return add_face(s, face_at(s, vertex, down), out);
    }
  }
}

void add_lowest_edge(const Placed& s, const Vec3& down, double reach, Corners& out) {
  const auto higher = [&](std::size_t one, std::size_t other) {
    return (out[one].point - out[other].point).dot(down) > reach;
  };
  switch (s.shape.core) {
    case Convex::Core::point:
      return out.add({s.at + s.shape.radius * down, 0, 0});
    case Convex::Core::segment:
    case Convex::Core::cylinder: {
      if (s.shape.core == Convex::Core::segment) {
        add_segment(s, down, out);
      } else {
        if (std::abs(s.turn.col(2).dot(down)) > kCap) return out.add({s.support(down), 2, 2});
        add_side(s, down, out);
      }
      if (higher(1, 0)) out[0] = out[1];
      if (out[0].feature == 1 || higher(0, 1)) {
        const Corner lowest = out[0];
        out.clear();
        out.add(lowest);
      }
      return;
    }
    case Convex::Core::polyhedron: {
      const Vec3 local = s.turn.transpose() * down;
      const std::uint32_t vertex = s.shape.farthest(local);
      const double lowest = s.shape.vertices[vertex].dot(local);
      double least = reach;
      std::optional<std::uint32_t> end;
      for (std::uint32_t i = s.shape.first_of[vertex]; i < s.shape.first_of[vertex + 1]; ++i) {
        if (s.shape.faces.empty()) break;
        const ConvexFace& face = s.shape.faces[s.shape.faces_of[i]];
        for (std::uint32_t k = 0; k < face.corners; ++k) {
          if (s.shape.rings[face.first + k] != vertex) continue;
          const std::uint32_t next = s.shape.rings[face.first + (k + 1) % face.corners];
          const double up = lowest - s.shape.vertices[next].dot(local);
          if (up > least) continue;
          least = up;
          end = next;
        }
      }
      // The lower number first, so that an edge has the same id whichever end is lower.
      const std::uint32_t first = end ? std::min(vertex, *end) : vertex;
      out.add({s.vertex(first), static_cast<int>(first % 32), 0});
      if (end) {
        const std::uint32_t second = std::max(vertex, *end);
        out.add({s.vertex(second), static_cast<int>(second % 32), 0});
      }
      return;
    }
  }
}

void cut_by_face(const Placed& s, std::uint32_t number, Corners& corners) {
  const ConvexFace& face = s.shape.faces[number];
  if (face.corners == 0) {
    const Vec3 axis = s.turn.col(2), u = across(axis), v = axis.cross(u);
    for (int i = 0; i < kDiscSides && corners.size() > 0; ++i) {
      const double angle = 2.0 * M_PI * i / kDiscSides;
      const Vec3 out = std::cos(angle) * u + std::sin(angle) * v;
      corners.cut(out, s.shape.disc_radius * (1.0 + 1e-9) + out.dot(s.at), i);
    }
    return;
  }
  const Vec3 normal = s.face_normal(number);
  Vec3 from = s.vertex(s.shape.rings[face.first + face.corners - 1]);
  for (std::uint32_t k = 0; k < face.corners && corners.size() > 0; ++k) {
    const Vec3 to = s.vertex(s.shape.rings[face.first + k]);
    const Vec3 out = (to - from).cross(normal);
    corners.cut(out, out.dot(from), static_cast<int>(k % 64));
    from = to;
  }
}

bool lies_over(const Placed& s, std::uint32_t number, const Vec3& point) {
  const ConvexFace& face = s.shape.faces[number];
  if (face.corners == 0) {
    const Vec3 axis = s.turn.col(2), from = point - s.at;
    return (from - from.dot(axis) * axis).squaredNorm() <= s.shape.disc_radius * s.shape.disc_radius;
  }
  const Vec3 local = s.turn.transpose() * (point - s.at);
  Vec3 from = s.shape.vertices[s.shape.rings[face.first + face.corners - 1]];
  for (std::uint32_t k = 0; k < face.corners; ++k) {
    const Vec3& to = s.shape.vertices[s.shape.rings[face.first + k]];
    if ((to - from).cross(face.normal).dot(local - from) > 0.0) return false;
    from = to;
  }
  return true;
}

}  // namespace subworld::bullet
