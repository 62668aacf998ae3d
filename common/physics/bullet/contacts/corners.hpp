#pragma once

#include "physics/bullet/convex.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

namespace subworld::bullet {

inline constexpr std::size_t kMostCorners = 64;

/// Corners of the feature of a surface that faces in a direction: a polygon, a line or a point.
struct Corner {
  Vec3 point;
  int feature = 0;
  int edge = 0;  ///< edge that starts here
};
class Corners {
 public:
  /// If the capacity is too small, only every second corner is stored, also of later ones, so that the rest surrounds
  /// the face.
  void add(const Corner& corner) {
    if (offered_++ % stride_ != 0) return;
    if (count_ == kMostCorners) {
      count_ /= 2;
      stride_ *= 2;
      for (std::size_t i = 1; i < count_; ++i) corners_[i] = corners_[2 * i];
    }
    corners_[count_++] = corner;
  }
  void clear() {
    count_ = offered_ = 0;
    stride_ = 1;
  }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] Corner& operator[](std::size_t i) { return corners_[i]; }
  [[nodiscard]] const Corner& operator[](std::size_t i) const { return corners_[i]; }
  [[nodiscard]] const Corner* begin() const { return corners_.data(); }
  [[nodiscard]] const Corner* end() const { return corners_.data() + count_; }

  /// Clips by a plane with this outward normal.
  void cut(const Vec3& outwards, double offset, int number);

 private:
  std::array<Corner, kMostCorners> corners_;
  std::size_t count_ = 0;
  std::size_t offered_ = 0, stride_ = 1;
};

/// A unit vector perpendicular to a direction.
[[nodiscard]] Vec3 across(const Vec3& direction);
/// The face at the lowest vertex of a polyhedron that faces down most.
[[nodiscard]] std::uint32_t face_at(const Placed& s, std::uint32_t vertex, const Vec3& down);
/// Adds the corners that a shape turns towards a plane below it. Ignores height differences below `fine` (m).
void add_lowest(const Placed& s, const Vec3& down, double fine, Corners& out);
/// The edge at the lowest point whose other end is at most `reach` higher, or the point alone.
void add_lowest_edge(const Placed& s, const Vec3& down, double reach, Corners& out);
/// Clips to the region over a face.
void cut_by_face(const Placed& s, std::uint32_t number, Corners& corners);
/// Whether a point is over a face.
[[nodiscard]] bool lies_over(const Placed& s, std::uint32_t number, const Vec3& point);

}  // namespace subworld::bullet
