#include "physics/bullet/solver/block_system.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <set>

namespace subworld::bullet {

namespace {

/// Added to each diagonal, relative to it. Loops in a plane lock some directions twice, and where copies of bodies were
/// shifted against each other, the two contradict each other a little: less would make large impulses of that, and
/// below the rounding of single precision the iterations diverge. More would make heavy bodies on light ones slow.
constexpr double kRegular = 1e-5;

}  // namespace

void BlockSystem::begin(std::span<const Node> nodes) {
  if (!std::ranges::equal(nodes, nodes_)) {
    nodes_.assign(nodes.begin(), nodes.end());
    order();
  }
  for (std::size_t i = 0; i < nodes_.size(); ++i) diagonals_[i].setZero(nodes_[i].size, nodes_[i].size);
  for (Edge& edge : edges_) edge.block.setZero(nodes_[edge.j].size, nodes_[edge.i].size);
}

void BlockSystem::order() {
  const auto count = static_cast<std::uint32_t>(nodes_.size());
  std::vector<std::set<std::uint32_t>> beside(count);
  const auto couples = [this](std::uint32_t i, std::uint32_t j) {
    const Node &x = nodes_[i], &y = nodes_[j];
    return (x.a != 0 && (x.a == y.a || x.a == y.b)) || (x.b != 0 && (x.b == y.a || x.b == y.b));
  };
  for (std::uint32_t i = 0; i < count; ++i) {
    for (std::uint32_t j = 0; j < count; ++j) {
      if (i != j && couples(i, j)) beside[i].insert(j);
    }
  }
  diagonals_.resize(count);
  order_.clear();
  edges_.clear();
  first_.assign(1, 0);
  std::vector<bool> done(count, false);
  while (order_.size() < count) {
    std::uint32_t next = count;
    for (std::uint32_t i = 0; i < count; ++i) {
      if (!done[i] && (next == count || beside[i].size() < beside[next].size())) next = i;
    }
    done[next] = true;
    order_.push_back(next);
    for (const std::uint32_t j : beside[next]) {
      edges_.push_back({next, j});
      beside[j].erase(next);
      for (const std::uint32_t k : beside[next]) {
        if (k != j) beside[j].insert(k);
      }
    }
    first_.push_back(static_cast<std::uint32_t>(edges_.size()));
  }
  updates_.clear();
  first_update_.assign(1, 0);
  for (std::uint32_t k = 0; k < count; ++k) {
    for (std::uint32_t left = first_[k]; left < first_[k + 1]; ++left) {
      for (std::uint32_t right = left + 1; right < first_[k + 1]; ++right)
        updates_.push_back({left, right, edge_between(edges_[left].j, edges_[right].j)});
    }
    first_update_.push_back(static_cast<std::uint32_t>(updates_.size()));
  }
}

std::uint32_t BlockSystem::edge_between(std::uint32_t i, std::uint32_t j) const {
  const auto joins = [&](const Edge& e) { return (e.i == i && e.j == j) || (e.i == j && e.j == i); };
  return static_cast<std::uint32_t>(std::ranges::find_if(edges_, joins) - edges_.begin());
}

void BlockSystem::decompose() {
  for (std::size_t k = 0; k < order_.size(); ++k) {
    Block& pivot = diagonals_[order_[k]];
    pivot.diagonal() *= 1.0 + kRegular;
    if (pivot.size() > 0) pivot = pivot.ldlt().solve(Block::Identity(pivot.rows(), pivot.cols())).eval();
    for (std::uint32_t u = first_update_[k]; u < first_update_[k + 1]; ++u) {
      const Edge &left = edges_[updates_[u].left], &right = edges_[updates_[u].right];
      Edge& target = edges_[updates_[u].target];
      if (target.i == left.j) {
        target.block.noalias() -= right.block * pivot * left.block.transpose();
      } else {
        target.block.noalias() -= left.block * pivot * right.block.transpose();
      }
    }
    for (std::uint32_t e = first_[k]; e < first_[k + 1]; ++e) {
      Edge& edge = edges_[e];
      const Block by = edge.block * pivot;
      diagonals_[edge.j].noalias() -= by * edge.block.transpose();
      edge.block = by;
    }
  }
}

void BlockSystem::solve(std::span<Values> values) const {
  for (const Edge& edge : edges_) values[edge.j].noalias() -= edge.block * values[edge.i];
  for (std::size_t i = 0; i < nodes_.size(); ++i) values[i] = (diagonals_[i] * values[i]).eval();
  for (auto edge = edges_.rbegin(); edge != edges_.rend(); ++edge)
    values[edge->i].noalias() -= edge->block.transpose() * values[edge->j];
}

}  // namespace subworld::bullet
