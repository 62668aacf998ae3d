#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Symmetric linear equations in blocks of up to six unknowns, most of them zero: each joint is a block, and two of
/// them are coupled where they share a body. Solved by Cholesky's decomposition in blocks, eliminating the block with
/// the fewest neighbours first: a chain or a tree has no other blocks than its own, a loop has few more.
class BlockSystem {
 public:
  using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
  using Values = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;

  /// A block and the two bodies that it couples to others; 0 couples to none.
  struct Node {
    std::uint32_t a, b;
    std::uint32_t size;  ///< unknowns
    bool operator==(const Node&) const = default;
  };
  /// Blocks that are not zero, i below j in the order of elimination.
  struct Edge {
    std::uint32_t i, j;
    Block block{};  ///< rows of j, columns of i
  };

  /// Zero equations of this shape. Costs little if it is that of the last call.
  void begin(std::span<const Node> nodes);
  [[nodiscard]] Block& diagonal(std::size_t i) { return diagonals_[i]; }
  /// To be filled; those that elimination adds stay zero.
  [[nodiscard]] std::span<Edge> edges() { return edges_; }
  /// Decomposes; then only solve() may be called.
  void decompose();
  /// Turns each right side into its unknowns.
  void solve(std::span<Values> values) const;

 private:
  void order();
  [[nodiscard]] std::uint32_t edge_between(std::uint32_t i, std::uint32_t j) const;

  std::vector<Node> nodes_;
  std::vector<Block> diagonals_;  ///< after decompose(), inverses
  std::vector<Edge> edges_;       ///< grouped by i, in the order of elimination
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> first_;  ///< of order_[k], its first edge; one more at the end
  /// Of each pair of edges of one block: that between their ends.
  struct Update {
    std::uint32_t left, right, target;
  };
  std::vector<Update> updates_;
  std::vector<std::uint32_t> first_update_;  ///< of order_[k]
};

}  // namespace subworld::bullet
