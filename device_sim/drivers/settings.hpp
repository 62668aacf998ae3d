#pragma once

#include <cstdlib>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>

namespace subworld {

/// "key=value" pairs, separated by spaces or commas. Wrong ones are a `std::invalid_argument`.
class DriverSettings {
 public:
  explicit DriverSettings(std::string_view text) {
    std::string spaced(text);
    for (char& c : spaced) {
      if (c == ',') c = ' ';
    }
    std::istringstream words(spaced);
    for (std::string word; words >> word;) {
      const std::size_t at = word.find('=');
      if (at == std::string::npos) throw std::invalid_argument("setting " + word + ": write it as key=value");
      values_[word.substr(0, at)] = word.substr(at + 1);
    }
  }
  std::string take(const std::string& key, const std::string& otherwise) {
    const auto found = values_.find(key);
    if (found == values_.end()) return otherwise;
    std::string value = found->second;
    values_.erase(found);
    return value;
  }
  double take(const std::string& key, double otherwise) {
    const std::string text = take(key, std::string());
    if (text.empty()) return otherwise;
    char* end = nullptr;
    const double value = std::strtod(text.c_str(), &end);
    if (*end != '\0') throw std::invalid_argument("setting " + key + "=" + text + ": must be a number");
    return value;
  }
  void check() const {
    if (!values_.empty()) throw std::invalid_argument("setting " + values_.begin()->first + " is unknown");
  }

 private:
  std::map<std::string, std::string> values_;
};

}  // namespace subworld
