#include "io/records/history_reader.hpp"

#include <cmath>
#include <cstdlib>
#include <limits>
#include <sstream>
#include <utility>

namespace subworld {

HistoryReader::HistoryReader(const std::string& file) : file_(file) {
  std::string line;
  std::getline(file_, line);
  std::istringstream names(line);
  for (std::string name; std::getline(names, name, ',');) columns_.emplace(name, columns_.size());
}

bool HistoryReader::next() {
  while (std::getline(file_, line_) && !file_.eof()) {
    if (!read_line() || read_.size() != columns_.size()) continue;
    std::swap(row_, read_);
    return true;
  }
  return false;
}

/// The numbers of the line; false where it holds anything else.
bool HistoryReader::read_line() {
  read_.clear();
  for (const char* at = line_.c_str();; ++at) {
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    if (*end != ',' && *end != '\0') return false;
    read_.push_back(end == at ? std::numeric_limits<double>::quiet_NaN() : value);
    if (*end == '\0') return true;
    at = end;
  }
}

double HistoryReader::at(const std::string& column) const {
  const auto place = find(column);
  return place && !row_.empty() ? row_[*place] : 0.0;
}

std::optional<std::size_t> HistoryReader::find(const std::string& column) const {
  const auto found = columns_.find(column);
  return found == columns_.end() ? std::nullopt : std::optional(found->second);
}

double HistoryReader::norm(const std::string& begin, const std::string& unit) const {
  return std::hypot(at(begin + "_x_" + unit), at(begin + "_y_" + unit), at(begin + "_z_" + unit));
}

}  // namespace subworld
