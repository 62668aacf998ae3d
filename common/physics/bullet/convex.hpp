#pragma once

#include "model/body.hpp"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// A face of a polyhedron, or a cap of a cylinder (which has no ring).
struct ConvexFace {
  Vec3 normal;              ///< unit, outwards
  double offset = 0.0;      ///< normal . p for its points p, m
  std::uint32_t first = 0;  ///< index of its corners in `Convex::rings`, counter-clockwise seen from outside
  std::uint32_t corners = 0;
};

/// The exact surface of a convex shape in its own frame: all points within `radius` of a core.
struct Convex {
  enum class Core : std::uint8_t { point, segment, cylinder, polyhedron };
  Core core = Core::point;
  double radius = 0.0;         ///< m; 0 for a cylinder and a polyhedron
  double disc_radius = 0.0;    ///< m, of a cylinder's caps
  double half_length = 0.0;    ///< m, along z, of a segment and a cylinder
  Vec3 centre = Vec3::Zero();  ///< a point well inside the shape
  double inner_radius = 0.0;   ///< m, of a ball around the centre inside the shape
  double outer_radius = 0.0;   ///< m, of a ball around the origin that contains the shape
  std::span<const Vec3> vertices{};
  std::span<const ConvexFace> faces{};
  std::span<const std::uint32_t> rings{};     ///< vertices of the faces
  std::span<const std::uint32_t> faces_of{};  ///< faces of vertex i: those numbered first_of[i] to first_of[i + 1]
  std::span<const std::uint32_t> first_of{};

  /// The vertex farthest in a direction.
  [[nodiscard]] std::uint32_t farthest(const Vec3& direction) const;
  /// The point of the core farthest in a direction (of any length).
  [[nodiscard]] Vec3 support(const Vec3& direction) const;
};

/// A Convex that owns its data.
class ConvexStorage {
 public:
  explicit ConvexStorage(const Shape& shape);
  /// The convex hull of the vertices.
  explicit ConvexStorage(const Mesh& mesh);
  /// Of a body that is not convex: the ball around it, and the radius of one inside.
  ConvexStorage(double outer_radius, double inner_radius);
  ConvexStorage(const ConvexStorage&) = delete;
  ConvexStorage& operator=(const ConvexStorage&) = delete;

  [[nodiscard]] const Convex& get() const { return convex_; }

 private:
  void add_box(const Vec3& half);
  void finish_polyhedron();

  Convex convex_;
  std::vector<Vec3> vertices_;
  std::vector<ConvexFace> faces_;
  std::vector<std::uint32_t> rings_, faces_of_, first_of_;
};

/// A triangle as a polyhedron with two faces and no volume.
class ConvexTriangle {
 public:
  ConvexTriangle(const Vec3& a, const Vec3& b, const Vec3& c);
  ConvexTriangle(const ConvexTriangle&) = delete;
  ConvexTriangle& operator=(const ConvexTriangle&) = delete;

  [[nodiscard]] const Convex& get() const { return convex_; }
  /// Zero if the triangle has no area.
  [[nodiscard]] const Vec3& normal() const { return faces_[0].normal; }

 private:
  Convex convex_;
  std::array<Vec3, 3> vertices_;
  std::array<ConvexFace, 2> faces_;
};

/// A Convex with a pose. Every argument and result is in the frame of the pose.
struct Placed {
  const Convex& shape;
  Eigen::Matrix3d turn;
  Vec3 at;

  [[nodiscard]] Vec3 point(const Vec3& local) const { return at + turn * local; }
  [[nodiscard]] Vec3 centre() const { return point(shape.centre); }
  [[nodiscard]] Vec3 vertex(std::uint32_t i) const { return point(shape.vertices[i]); }
  [[nodiscard]] Vec3 face_normal(std::uint32_t i) const { return turn * shape.faces[i].normal; }
  [[nodiscard]] double face_offset(std::uint32_t i) const { return shape.faces[i].offset + face_normal(i).dot(at); }
  /// Support point of the core, scaled about the centre by `kept`.
  [[nodiscard]] Vec3 support(const Vec3& direction, double kept = 1.0) const {
    const Vec3 local = shape.support(turn.transpose() * direction);
    return point(kept == 1.0 ? local : Vec3(shape.centre + kept * (local - shape.centre)));
  }
  /// Extent of the surface in a direction of unit length, m.
  [[nodiscard]] double reach(const Vec3& direction) const { return support(direction).dot(direction) + shape.radius; }
};

}  // namespace subworld::bullet
