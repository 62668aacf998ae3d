#include "physics/box_tree.hpp"

namespace subworld {

namespace {

/// Half of the surface area.
double area(const Box& box) noexcept {
  const Vec3 size = box.upper - box.lower;
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

Box around(Box a, const Box& b) noexcept {
  a.extend(b);
  return a;
}

}  // namespace

BoxTree::BoxTree(std::size_t count) : leaf_of_(count, kNone) {
  nodes_.reserve(2 * count + 1);
  free_.reserve(2 * count + 1);
  stack_.reserve(256);
}

BoxTree::Index BoxTree::new_node() {
  if (free_.empty()) {
    nodes_.emplace_back();
    return static_cast<Index>(nodes_.size() - 1);
  }
  const Index node = free_.back();
  free_.pop_back();
  nodes_[node] = {};
  return node;
}

/// Descends to the sibling for which the tree's surface grows least (surface area heuristic: Goldsmith and Salmon
/// 1987).
BoxTree::Index BoxTree::best_sibling(const Box& box) const {
  Index at = root_;
  while (nodes_[at].left != kNone) {
    const double here = 2.0 * area(around(nodes_[at].box, box));
    const double inherited = here - 2.0 * area(nodes_[at].box);
    const auto cost = [&](Index child) {
      const Node& node = nodes_[child];
      const double grown = area(around(node.box, box));
      return inherited + (node.left == kNone ? grown : grown - area(node.box));
    };
    const double left = cost(nodes_[at].left), right = cost(nodes_[at].right);
    if (here < left && here < right) break;
    at = left < right ? nodes_[at].left : nodes_[at].right;
  }
  return at;
}

void BoxTree::replace(Index parent, Index old_child, Index child) {
  if (parent == kNone) {
    root_ = child;
  } else {
    (nodes_[parent].left == old_child ? nodes_[parent].left : nodes_[parent].right) = child;
  }
  if (child != kNone) nodes_[child].parent = parent;
}

void BoxTree::refit(Index node) {
  for (; node != kNone; node = nodes_[node].parent) {
    nodes_[node].box = around(nodes_[nodes_[node].left].box, nodes_[nodes_[node].right].box);
  }
}

void BoxTree::insert(std::uint32_t item, const Box& box) {
  const Index leaf = new_node();
  nodes_[leaf].box = box;
  nodes_[leaf].item = item;
  leaf_of_[item] = leaf;
  if (root_ == kNone) {
    root_ = leaf;
    return;
  }
  const Index sibling = best_sibling(box);
  const Index parent = new_node();
  replace(nodes_[sibling].parent, sibling, parent);
  nodes_[parent].left = sibling;
  nodes_[parent].right = leaf;
  nodes_[sibling].parent = nodes_[leaf].parent = parent;
  refit(parent);
}

void BoxTree::remove(std::uint32_t item) {
  const Index leaf = leaf_of_[item];
  leaf_of_[item] = kNone;
  free_.push_back(leaf);
  const Index parent = nodes_[leaf].parent;
  if (parent == kNone) {
    root_ = kNone;
    return;
  }
  const Index sibling = nodes_[parent].left == leaf ? nodes_[parent].right : nodes_[parent].left;
  const Index above = nodes_[parent].parent;
  replace(above, parent, sibling);
  free_.push_back(parent);
  refit(above);
}

}  // namespace subworld
