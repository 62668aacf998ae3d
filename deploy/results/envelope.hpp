#pragma once

#include <utility>
#include <vector>

namespace subworld {

/// A long curve in few points: the least and the largest value of each of at most `kBins` intervals, so that no peak is
/// lost. The intervals hold equally many points, and are merged in pairs when there are too many.
class Envelope {
 public:
  static constexpr std::size_t kBins = 720;  ///< a pixel of a plot each; even

  /// A point; values that are not finite are skipped.
  void add(double x, double y);
  [[nodiscard]] bool empty() const noexcept { return bins_.empty(); }
  /// The largest value; 0 where there is none.
  [[nodiscard]] double largest() const noexcept;
  /// In the order of x.
  [[nodiscard]] std::vector<std::pair<double, double>> points() const;

 private:
  using Point = std::pair<double, double>;
  struct Bin {
    Point low, high;
  };
  void merge();

  std::vector<Bin> bins_;
  std::size_t per_bin_ = 1, in_last_ = 0;
};

}  // namespace subworld
