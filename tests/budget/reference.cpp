// What a build is measured by: a fixed source that needs the standard library only. Reading, instantiating and
// optimising have about the shares that they have in the product. A change of it changes the unit of the figures beside
// it.
#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <numeric>
#include <random>
#include <regex>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

namespace {

template <int N>
struct Key {
  std::array<int, N + 1> words{};
  auto operator<=>(const Key&) const = default;
};

template <int N>
double sorted_sum(std::mt19937& random) {
  std::map<Key<N>, std::vector<double>> values;
  std::vector<std::tuple<Key<N>, double, std::string>> rows;
  std::uniform_real_distribution<double> number;
  for (int i = 0; i < 100; ++i) {
    Key<N> key;
    std::generate(key.words.begin(), key.words.end(), std::ref(random));
    values[key].push_back(number(random));
    rows.emplace_back(key, number(random), std::to_string(i));
  }
  std::sort(rows.begin(), rows.end());
  std::stable_sort(rows.begin(), rows.end(),
                   [](const auto& a, const auto& b) { return std::get<1>(a) < std::get<1>(b); });
  const std::function<double(double, const std::tuple<Key<N>, double, std::string>&)> add =
      [&values](double sum, const auto& row) { return sum + std::get<1>(row) + static_cast<double>(values.size()); };
  return std::accumulate(rows.begin(), rows.end(), 0.0, add);
}

template <int N>
using Choice = std::variant<double, std::string, std::vector<int>, Key<N>>;

template <int N>
double visited(std::mt19937& random) {
  std::vector<Choice<N>> choices{1.0, std::string("two"), std::vector<int>{3}, Key<N>{}};
  std::shuffle(choices.begin(), choices.end(), random);
  double sum = 0.0;
  for (std::size_t i = 1; i < choices.size(); ++i) {
    sum += std::visit([](const auto& a, const auto& b) { return static_cast<double>(sizeof a + 2 * sizeof b); },
                      choices[i - 1], choices[i]);
  }
  return sum;
}

template <int... N>
double all(std::integer_sequence<int, N...>, std::mt19937& random) {
  return (0.0 + ... + (sorted_sum<N>(random) + visited<N>(random)));
}

}  // namespace

double reference(const std::string& text) {
  std::mt19937 random(1);
  const std::regex words("([a-z]+)=([0-9.]+)(;|$)");
  const auto count = std::distance(std::sregex_iterator(text.begin(), text.end(), words), {});
  return static_cast<double>(count) + all(std::make_integer_sequence<int, 2>{}, random);
}
