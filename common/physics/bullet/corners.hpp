#pragma once

#include "convex.hpp"

#include <array>
#include <cstddef>
#include <cstdint>

namespace subworld::bullet {

inline constexpr std::size_t kMostCorners = 64;

/// Corners of the part of a surface that looks in a direction: a polygon, a line or a point.
struct Corner {
  Vec3 point;
  int feature = 0;
  int edge = 0;  ///< that starts here
};
class Corners {
 public:
  /// Where there is no room for all, only every second one counts, of those to come too: what is left goes all around.
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

  /// Leaves what is on the inner side of a plane with this outward normal.
  void cut(const Vec3& outwards, double offset, int number);

 private:
  std::array<Corner, kMostCorners> corners_;
  std::size_t count_ = 0;
  std::size_t offered_ = 0, stride_ = 1;
};

/// Some unit vector across a direction.
[[nodiscard]] Vec3 across(const Vec3& direction);
/// The face of a polyhedron at its lowest vertex that looks down most.
[[nodiscard]] std::uint32_t face_at(const Placed& s, std::uint32_t vertex, const Vec3& down);
/// What a shape turns to a plane below it. Heights that differ by less than `fine` (m) do not count.
void add_lowest(const Placed& s, const Vec3& down, double fine, Corners& out);
/// The edge at the lowest point whose other end is no more than `reach` higher, or the point alone.
void add_lowest_edge(const Placed& s, const Vec3& down, double reach, Corners& out);
/// Leaves what lies over a face.
void cut_by_face(const Placed& s, std::uint32_t number, Corners& corners);
/// Whether a point does.
[[nodiscard]] bool lies_over(const Placed& s, std::uint32_t number, const Vec3& point);

}  // namespace subworld::bullet
