#include "model/scene/scene_layout.hpp"

#include "model/hash.hpp"
#include "model/trigonometry.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  /// In [-1, 1).
  double symmetric() {
    const std::uint64_t bits = random_bits(state_);
    state_ += kRandomStep;
    return static_cast<double>(bits >> 11U) * 0x1p-52 - 1.0;
  }

  /// A point of the unit ball in n dimensions, by rejection. Points too near the centre to be normalised are rejected
  /// too.
  template <int n>
  Eigen::Matrix<double, n, 1> in_ball() {
    for (;;) {
      Eigen::Matrix<double, n, 1> v;
      for (int i = 0; i < n; ++i) v[i] = symmetric();
      const double square = v.squaredNorm();
      if (square <= 1.0 && square > 1e-6) return v;
    }
  }

 private:
  std::uint64_t state_;
};

Quat random_rotation(Random& random, double max_tilt_deg) {
  if (max_tilt_deg >= 180.0) return Quat(random.in_ball<4>()).normalized();
  const SinCos half = sin_cos_deg(0.5 * max_tilt_deg);
  const Vec3 v = half.sin / half.cos * random.in_ball<3>();
  return Quat(1.0, v.x(), v.y(), v.z()).normalized();
}

}  // namespace

Layout lay_out(const GridLayout& grid) {
  Layout layout;
  for (int z = 0; z < grid.counts[2]; ++z) {
    for (int y = 0; y < grid.counts[1]; ++y) {
      for (int x = 0; x < grid.counts[0]; ++x) {
        Vec3 offset = grid.steps * Vec3(x, y, z);
        if (x % 2 == 1) offset += grid.odd_column_shift;
        layout.push_back({offset, Quat::Identity()});
      }
    }
  }
  return layout;
}

Layout lay_out(const HeapLayout& heap) {
  // A rotation by t moves a point at distance d by at most 2 d sin(t/2), and no point leaves the bounding sphere.
  const double reach = 2.0 * heap.bounding_radius * sin_cos_deg(0.5 * heap.max_tilt_deg).sin;
  const Vec3 half = (heap.half_extents.array() + reach).min(heap.bounding_radius);
  const Vec3 cell = 2.0 * half + Vec3::Constant(heap.gap);
  const auto across = [&](std::size_t axis) {
    return static_cast<int>(std::min(1e6, std::floor(heap.area[axis] / cell[static_cast<int>(axis)])));
  };
  const std::array<int, 2> cells{across(0), across(1)};
  if (cells[0] < 1 || cells[1] < 1) return {};
  const std::array<double, 2> pitch{heap.area[0] / cells[0], heap.area[1] / cells[1]};
  const auto per_layer = static_cast<std::int64_t>(cells[0]) * cells[1];
  Random random(heap.seed);
  Layout layout;
  for (int i = 0; i < heap.count; ++i) {
    const auto in_layer = static_cast<int>(i % per_layer);
    const auto layer = static_cast<double>(i / per_layer);
    const double jitter_x = 0.5 * (pitch[0] - cell.x()) * random.symmetric();
    const double jitter_y = 0.5 * (pitch[1] - cell.y()) * random.symmetric();
    const Quat rotation = random_rotation(random, heap.max_tilt_deg);
    layout.push_back(
        {Vec3((in_layer % cells[0] + 0.5) * pitch[0] - 0.5 * heap.area[0] + jitter_x,
              (in_layer / cells[0] + 0.5) * pitch[1] - 0.5 * heap.area[1] + jitter_y, (layer + 0.5) * cell.z()),
         rotation});
  }
  return layout;
}

Layout lay_out(const CardHouseLayout& house) {
  const auto [sine, cosine] = sin_cos_deg(house.lean_deg);
  const double length = house.card_size.x();
  const double thickness = house.card_size.z();
  const double pitch = length + house.gap;
  Layout layout;
  double ground = 0.0;
  for (int pairs = house.stages; pairs > 0; --pairs) {
    for (int k = 0; k < pairs; ++k) {
      const double ridge = (k - 0.5 * (pairs - 1)) * pitch;
      for (const double side : {-1.0, 1.0}) {
        // The middle of the inner face, then half a thickness away from the partner and up.
        const double x = ridge + side * 0.5 * (house.gap + length * sine + thickness * cosine);
        const double z = ground + house.gap + 0.5 * (length * cosine + thickness * sine);
        layout.push_back({Vec3(x, 0.0, z), rotation_deg(Vec3::UnitY(), -90.0 - side * house.lean_deg)});
      }
    }
    ground += house.gap + length * cosine + thickness * sine;
    const int floor = house.stages - pairs + 1;
    const bool doubled =
        std::find(house.double_floors.begin(), house.double_floors.end(), floor) != house.double_floors.end();
    for (int layer = 0; layer < (pairs == 1 ? 0 : doubled ? 2 : 1); ++layer) {
      for (int k = 0; k + 1 < pairs; ++k) {
        layout.push_back(
            {Vec3((k - 0.5 * (pairs - 2)) * pitch, 0.0, ground + house.gap + 0.5 * thickness), Quat::Identity()});
      }
      ground += house.gap + thickness;
    }
  }
  return layout;
}

std::int64_t card_count(const CardHouseLayout& house) noexcept {
  const std::int64_t stages = house.stages;
  std::int64_t count = stages * (stages + 1) + stages * (stages - 1) / 2;
  for (const int floor : house.double_floors) count += stages - floor;
  return count;
}

bool fits(const CardHouseLayout& house) noexcept {
  const auto [sine, cosine] = sin_cos_deg(house.lean_deg);
  const double half = 0.5 * house.gap + house.card_size.x() * sine + house.card_size.z() * cosine;
  return 2.0 * half <= house.card_size.x() + house.gap;
}

}  // namespace subworld
