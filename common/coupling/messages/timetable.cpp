#include "coupling/messages/timetable.hpp"

namespace subworld {

Timetable::Timetable(int ratio, std::uint64_t remembered_cycles) : remembered_(remembered_cycles) {
  entries_.reserve(remembered_ + 2);
  restart(0, 0, ratio);
}

void Timetable::restart(std::uint64_t stamp, std::uint64_t step, int ratio) {
  entries_.assign(1, {stamp, step, ratio});
}

void Timetable::plan(const RatioChange& change) {
  const Entry& last = entries_.back();
  if (change.stamp <= last.stamp || change.ratio == last.ratio) return;
  const Entry next{change.stamp, start(change.stamp), change.ratio};
  std::size_t over = 0;
  while (over + 1 < entries_.size() && entries_[over + 1].stamp + remembered_ < next.stamp) ++over;
  entries_.erase(entries_.begin(), entries_.begin() + static_cast<std::ptrdiff_t>(over));
  entries_.push_back(next);
}

RatioChange Timetable::newest() const noexcept { return {entries_.back().stamp, entries_.back().ratio}; }

std::uint64_t Timetable::start(std::uint64_t stamp) const noexcept {
  const Entry& entry = at(stamp);
  const auto ratio = static_cast<std::uint64_t>(entry.ratio);
  return stamp < entry.stamp ? entry.start - (entry.stamp - stamp) * ratio
                             : entry.start + (stamp - entry.stamp) * ratio;
}

const Timetable::Entry& Timetable::at(std::uint64_t stamp) const noexcept {
  auto entry = entries_.end() - 1;
  while (entry != entries_.begin() && entry->stamp > stamp) --entry;
  return *entry;
}

}  // namespace subworld
