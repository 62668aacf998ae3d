#pragma once

#include "model/types.hpp"

#include <cstdint>
#include <vector>

namespace subworld {

/// Axis-aligned boxes, searched by place: a binary tree whose nodes bound their children. The time of insert and remove
/// grows with the tree's depth. After construction only `find` allocates, once, for its stack.
class BoxTree {
 public:
  /// Capacity: the items 0 .. count - 1.
  explicit BoxTree(std::size_t count);

  void insert(std::uint32_t item, const Box& box);
  void remove(std::uint32_t item);
  [[nodiscard]] bool contains(std::uint32_t item) const noexcept { return leaf_of_[item] != kNone; }
  [[nodiscard]] const Box& box(std::uint32_t item) const noexcept { return nodes_[leaf_of_[item]].box; }

  /// Calls `found` with each item whose box intersects this one. `found` may not change the tree.
  template <class Found>
  void find(const Box& box, Found found) const {
    if (root_ == kNone) return;
    stack_.assign(1, root_);
    while (!stack_.empty()) {
      const Node& node = nodes_[stack_.back()];
      stack_.pop_back();
      if (!node.box.meets(box)) continue;
      if (node.left == kNone) {
        found(node.item);
      } else {
        stack_.push_back(node.left);
        stack_.push_back(node.right);
      }
    }
  }

 private:
  using Index = std::uint32_t;
  static constexpr Index kNone = 0xFFFFFFFF;

  struct Node {
    Box box;
    Index parent = kNone;
    Index left = kNone;  ///< kNone for a leaf
    Index right = kNone;
    std::uint32_t item = 0;
  };

  [[nodiscard]] Index new_node();
  [[nodiscard]] Index best_sibling(const Box& box) const;
  void refit(Index node);
  void replace(Index parent, Index old_child, Index child);

  std::vector<Node> nodes_;
  std::vector<Index> free_;
  std::vector<Index> leaf_of_;  ///< by item
  Index root_ = kNone;
  mutable std::vector<Index> stack_;
};

}  // namespace subworld
