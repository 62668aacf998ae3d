// What travels is what the IDL says.
#include "wire/codec/cdr.hpp"
#include "wire/codec/schema.hpp"
#include "wire/topics.hpp"

#include <gtest/gtest.h>

#include <map>
#include <regex>
#include <string>
#include <tuple>
#include <vector>

namespace subworld {
namespace {

struct IdlField {
  bool key = false;
  std::string type, name;
};
using Idl = std::map<std::string, std::vector<IdlField>>;

Idl parse(std::string_view text) {
  static const std::regex kStruct(R"(struct (\w+) \{([^}]*)\})"), kField(R"((@key )?([\w <>]+) (\w+);)");
  const std::string bare = std::regex_replace(std::string(text), std::regex("//[^\n]*"), "");
  Idl idl;
  for (std::sregex_iterator at(bare.begin(), bare.end(), kStruct), end; at != end; ++at) {
    const std::string body = (*at)[2];
    for (std::sregex_iterator field(body.begin(), body.end(), kField); field != end; ++field) {
      const std::string type = std::regex_replace((*field)[2].str(), std::regex("^\\s+"), "");
      idl[(*at)[1]].push_back({(*field)[1].matched, type, (*field)[3]});
    }
  }
  return idl;
}

/// The archive that compares names, types and order of the fields with a struct of the IDL.
class Comparison {
 public:
  Comparison(const Idl& idl, std::string name, std::vector<std::string>& faults)
      : idl_(idl), name_(std::move(name)), faults_(faults) {
    if (!idl.contains(name_)) faults_.push_back(name_ + " is no struct");
  }

  Changes changes;

  bool operator()(const std::string& name, auto&& value) {
    if (name.empty()) return compare(element_, value);
    const auto found = idl_.find(name_);
    const bool there = found != idl_.end() && at_ < found->second.size();
    const IdlField field = there ? found->second[at_++] : IdlField{};
    if (field.name != name) faults_.push_back(name_ + "::" + name + " is \"" + field.name + "\" in the IDL");
    if (field.name == name) compare(field.type, value);
    return true;
  }
  bool operator()(const std::string& name, auto&, auto& sent) { return (*this)(name, sent); }
  bool sequence(const std::string& name, auto& all, auto visit) {
    (*this)(name, all);
    const std::string type = idl_.at(name_)[at_ - 1].type;
    element_ = type.substr(type.find('<') + 1, type.size() - type.find('<') - 2);
    return visit(std::size_t{0}, all.emplace_back());
  }
  bool check(bool) { return true; }
  void end() {
    const auto found = idl_.find(name_);
    if (found != idl_.end() && at_ < found->second.size())
      faults_.push_back(name_ + "::" + found->second[at_].name + " does not travel");
  }

 private:
  bool compare(const std::string& type, auto& value) {
    using T = std::remove_cvref_t<decltype(value)>;
    const auto basic = [&](const char* expected) {
      if (type != expected) faults_.push_back(name_ + ": " + expected + " is " + type + " in the IDL");
      return true;
    };
    if constexpr (std::is_enum_v<T>) {
      std::underlying_type_t<T> number{};
      return compare(type, number);
    } else if constexpr (std::same_as<T, bool>)
      return basic("boolean");
    else if constexpr (std::same_as<T, std::uint8_t>)
      return basic("octet");
    else if constexpr (std::same_as<T, std::uint32_t> || std::same_as<T, int>)
      return basic("unsigned long");
    else if constexpr (std::same_as<T, std::uint64_t>)
      return basic("unsigned long long");
    else if constexpr (std::same_as<T, std::int64_t>)
      return basic("long long");
    else if constexpr (std::same_as<T, double>)
      return basic("double");
    else if constexpr (std::same_as<T, std::string>)
      return basic("string");
    else if constexpr (std::same_as<T, Vec3>)
      return basic("Vector");
    else if constexpr (std::same_as<T, Quat>)
      return basic("Quaternion");
    else if constexpr (std::same_as<T, std::array<std::uint32_t, 3>>)
      return basic("Triangle");
    else if constexpr (Sequence<T> || Optional<T>) {
      if (!type.starts_with("sequence<")) return basic("sequence");
      typename T::value_type element{};
      return compare(type.substr(9, type.size() - 10), element);
    } else {
      Comparison inner(idl_, type, faults_);
      fields(inner, value);
      inner.end();
      return true;
    }
  }

  const Idl& idl_;
  std::string name_, element_;
  std::vector<std::string>& faults_;
  std::size_t at_ = 0;
};

std::vector<std::string> faults_of(std::string_view text) {
  const Idl idl = parse(text);
  std::vector<std::string> faults;
  const auto compare = [&]<class M>(const Topic<M>& row) {
    const std::string name = std::string(row.spec.type).substr(std::string_view("subworld::msg::").size());
    Comparison topic(idl, name, faults);
    M message;
    fields(topic, message);
    topic.end();
    const auto& all = idl.at(name);
    if (std::ranges::count(all, true, &IdlField::key) != row.spec.key_words) faults.push_back(name + ": keys");
  };
  std::apply([&](const auto&... rows) { (compare(rows), ...); }, kTopicTable);
  return faults;
}

TEST(WireFields, AreThoseOfTheIdl) {
  EXPECT_GT(parse(wire_idl()).size(), 20U);
  EXPECT_EQ(faults_of(wire_idl()), std::vector<std::string>{});
}

TEST(WireFields, OfAnotherIdlAreNoticed) {
  const auto with = [](const char* from, const char* to) {
    const std::string text = std::regex_replace(std::string(wire_idl()), std::regex(from), to);
    EXPECT_NE(text, wire_idl()) << from;
    return faults_of(text).size();
  };
  EXPECT_GT(with("double radius", "double diameter"), 0U) << "another name";
  EXPECT_GT(with("double radius", "unsigned long radius"), 0U) << "another type";
  EXPECT_GT(with("double radius;", ""), 0U) << "a field less";
  EXPECT_GT(with("double radius;", "double radius; double density;"), 0U) << "a field more";
  EXPECT_GT(with("boolean as_in_base;(.*)\n.*values;", "sequence<unsigned long> values; boolean as_in_base;"), 0U)
      << "another order";
  EXPECT_GT(with("@key unsigned long user", "unsigned long user"), 0U) << "a key less";
  EXPECT_GT(with("sequence<State> states", "sequence<Pose> states"), 0U) << "other elements";
}

}  // namespace
}  // namespace subworld
