#pragma once

#include "model/body.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

/// Poses of the bodies of a repetition group: pure geometry, equal bits on every machine.
namespace subworld {

/// Offsets from the group's position in world axes, and rotations that are applied after the body's own.
using Layout = std::vector<Pose>;

struct GridLayout {
  std::array<int, 3> counts{1, 1, 1};               ///< x runs fastest, then y, then z
  Eigen::Matrix3d steps = Eigen::Matrix3d::Zero();  ///< m, centre to centre, one column for each count
  Vec3 odd_column_shift = Vec3::Zero();             ///< m, shift of every second column along x
};
[[nodiscard]] Layout lay_out(const GridLayout& grid);

/// Bodies poured from above: layers of cells, one body in each, with a random position in its cell and a random
/// rotation. Bodies do not overlap. The group's position is the centre of the underside of the lowest layer.
struct HeapLayout {
  int count = 0;
  std::array<double, 2> area{0.0, 0.0};  ///< m, along x and y
  double max_tilt_deg = 180.0;           ///< largest rotation, about any axis; 180: every orientation is equally likely
  double gap = 0.001;                    ///< m, between neighbouring cells
  std::uint64_t seed = 0;
  Vec3 half_extents = Vec3::Zero();  ///< m, of the body
  double bounding_radius = 0.0;      ///< m, of the body
};
/// Empty if the area is too small for one body.
[[nodiscard]] Layout lay_out(const HeapLayout& heap);

/// A pyramid of leaning pairs: `stages` pairs in the lowest stage and one less in each stage above. Between two stages
/// is a floor of flat cards from ridge to ridge. The card is a box of length (x), width (y) and thickness (z). In a
/// pair, the lower edges of the inner faces stand on the floor and their upper edges touch. The group's position is the
/// middle of the ground.
struct CardHouseLayout {
  int stages = 0;
  double lean_deg = 20.0;          ///< from the vertical
  double gap = 0.0;                ///< m, between any two cards that would touch
  Vec3 card_size = Vec3::Zero();   ///< m
  std::vector<int> double_floors;  ///< floors (1 is the lowest) with two layers of cards
};
[[nodiscard]] Layout lay_out(const CardHouseLayout& house);
/// Number of cards of the house.
[[nodiscard]] std::int64_t card_count(const CardHouseLayout& house) noexcept;
/// Whether neighbouring pairs do not overlap.
[[nodiscard]] bool fits(const CardHouseLayout& house) noexcept;

}  // namespace subworld
