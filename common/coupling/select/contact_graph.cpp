#include "coupling/select/contact_graph.hpp"

#include "model/sorted.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

void ContactGraph::build(std::span<const Contact> contacts, std::size_t bodies) {
  contacts_ = contacts;
  begin_.resize(bodies);
  count_.resize(bodies);
  for (const BodyId id : touched_) begin_[index(id)] = count_[index(id)] = 0;
  touched_.clear();
  const auto count = [this](BodyId id) {
    if (count_[index(id)]++ == 0) touched_.push_back(id);
  };
  for (const Contact& c : contacts) {
    count(c.a);
    count(c.b);
  }
  std::uint32_t end = 0;
  for (const BodyId id : touched_) {
    begin_[index(id)] = end;
    end += std::exchange(count_[index(id)], 0);
  }
  entries_.resize(end);
  const auto enter = [this](BodyId id, std::uint32_t i) { entries_[begin_[index(id)] + count_[index(id)]++] = i; };
  for (std::uint32_t i = 0; i < contacts.size(); ++i) {
    enter(contacts[i].a, i);
    enter(contacts[i].b, i);
  }
}

void ContactGraph::contacts_of(std::span<const BodyId> ids, std::vector<Contact>& out) const {
  listed_.clear();
  for (const BodyId id : ids) {
    const auto entries = std::span(entries_).subspan(begin_[index(id)], count_[index(id)]);
    listed_.insert(listed_.end(), entries.begin(), entries.end());
  }
  std::ranges::sort(listed_);
  const auto twice = std::ranges::unique(listed_);
  listed_.erase(twice.begin(), twice.end());
  out.clear();
  for (const std::uint32_t i : listed_) out.push_back(contacts_[i]);
}

void Islands::begin(std::span<const BodyId> ids) {
  ids_.assign(ids.begin(), ids.end());
  sets_.reset(ids.size());
  open_.assign(ids.size(), false);
}

std::size_t Islands::place(BodyId id) const noexcept {
  return static_cast<std::size_t>(find_sorted(ids_, id) - ids_.begin());
}

void Islands::join(BodyId a, BodyId b) noexcept {
  const std::size_t at_a = place(a);
  const std::size_t at_b = place(b);
  if (at_a == ids_.size()) return open(b);
  if (at_b == ids_.size()) return open(a);
  const std::uint32_t root_a = sets_.root(static_cast<std::uint32_t>(at_a));
  const std::uint32_t root_b = sets_.root(static_cast<std::uint32_t>(at_b));
  open_[std::min(root_a, root_b)] = open_[root_a] || open_[root_b];
  sets_.join(std::min(root_a, root_b), std::max(root_a, root_b));
}

void Islands::open(BodyId id) noexcept {
  const std::size_t at = place(id);
  if (at != ids_.size()) open_[sets_.root(static_cast<std::uint32_t>(at))] = true;
}

void Islands::join(std::span<const BodyId> ids, std::span<const std::uint32_t> labels) noexcept {
  for (std::size_t i = 0; i < std::min(ids.size(), labels.size()); ++i) {
    if (labels[i] == kOpenIsland) {
      open(ids[i]);
    } else if (labels[i] < ids.size() && labels[i] != i) {
      join(ids[i], ids[labels[i]]);
    }
  }
}

bool Islands::is_open(BodyId id) noexcept {
  const std::size_t at = place(id);
  return at == ids_.size() || open_[sets_.root(static_cast<std::uint32_t>(at))];
}

void Islands::labels(std::vector<std::uint32_t>& out) {
  out.resize(ids_.size());
  for (std::uint32_t i = 0; i < ids_.size(); ++i) out[i] = open_[sets_.root(i)] ? kOpenIsland : sets_.root(i);
}

}  // namespace subworld
