#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "wire/changes.hpp"
#include "wire/readable.hpp"

#include <subworld.h>

#include <cmath>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

/// The two directions of wire/convert.
namespace subworld {

/// A unit quaternion whose norm is off by less than this is not changed, so that both ends of a topic have equal
/// numbers.
inline constexpr double kQuaternionExact = 1e-6;
/// A quaternion whose norm is off by more than this is invalid; between the two limits it is normalised.
inline constexpr double kQuaternionNear = 1e-2;

/// A model struct, constant while it is sent.
template <class T, class Struct>
concept Is = std::same_as<std::remove_const_t<T>, Struct>;
template <class T>
concept Sequence = Is<T, std::vector<typename T::value_type>>;
template <class T>
concept Optional = Is<T, std::optional<typename T::value_type>>;

/// Copies a model to the wire. Everything counts as valid: the receiver decides.
struct ToWire {
  Delta delta = {};  ///< of topics that carry changes

  bool operator()(const Vec3& model, msg::Vector& wire) const {
    wire = {model.x(), model.y(), model.z()};
    return true;
  }
  bool operator()(const Quat& model, msg::Quaternion& wire) const {
    wire = {model.w(), model.x(), model.y(), model.z()};
    return true;
  }
  bool operator()(const Eigen::Matrix3d& model, msg::SymmetricTensor& wire) const {
    wire.xx() = model(0, 0);
    wire.yy() = model(1, 1);
    wire.zz() = model(2, 2);
    wire.xy() = model(0, 1);
    wire.yz() = model(1, 2);
    wire.zx() = model(2, 0);
    return true;
  }
  bool operator()(const std::string& model, std::string& wire) const {
    wire = readable(model);
    return true;
  }
  template <class M, class W>
  bool operator()(const M& model, W& wire) const {
    if constexpr (std::is_arithmetic_v<W>) {
      wire = static_cast<W>(model);
    } else if constexpr (std::same_as<M, W> && !Sequence<M>) {
      wire = model;
    } else {
      fields(*this, model, wire);
    }
    return true;
  }

  bool not_negative(double model, double& wire) const { return (*this)(model, wire); }
  bool positive(double model, double& wire) const { return (*this)(model, wire); }
  bool ratio(int model, std::uint32_t& wire) const { return (*this)(model, wire); }
  bool kind(auto model, auto& wire, auto) const { return (*this)(model, wire); }
  bool same(BodyId model, std::uint32_t& wire) const { return (*this)(model, wire); }
  bool check(bool) const { return true; }

  /// Also reserves what the model has reserved, so that a loop does not allocate.
  void resize(const auto& model, auto& wire) const {
    wire.reserve(model.capacity());
    wire.resize(model.size());
  }
  bool length(auto& wire, std::size_t size) const {
    wire.resize(size);
    return true;
  }
  void present(const auto& model, bool& wire) const { wire = model.has_value(); }
  void present(const auto& model, auto& wire) const {
    wire.reserve(1);
    wire.resize(model ? 1 : 0);
  }
};

/// Copies the wire to a model.
struct FromWire {
  Delta delta = {};  ///< of topics that carry changes

  bool operator()(Vec3& model, const msg::Vector& wire) const {
    model = Vec3{wire[0], wire[1], wire[2]};
    return model.allFinite();
  }
  bool operator()(Quat& model, const msg::Quaternion& wire) const {
    model = Quat{wire[0], wire[1], wire[2], wire[3]};
    const double off = std::abs(model.squaredNorm() - 1.0);
    if (!(off <= kQuaternionNear)) return false;
    if (off > kQuaternionExact) model.normalize();
    return true;
  }
  /// Refuses an inertia that no body can have.
  bool operator()(Eigen::Matrix3d& model, const msg::SymmetricTensor& wire) const {
    model << wire.xx(), wire.xy(), wire.zx(), wire.xy(), wire.yy(), wire.yz(), wire.zx(), wire.yz(), wire.zz();
    return model.allFinite() && model.llt().info() == Eigen::Success;
  }
  bool operator()(std::string& model, const std::string& wire) const {
    model = wire;
    return readable(wire) == wire;
  }
  template <class M, class W>
  bool operator()(M& model, const W& wire) const {
    if constexpr (std::is_floating_point_v<W>) {
      model = wire;
      return std::isfinite(wire);
    } else if constexpr (std::is_arithmetic_v<W>) {
      model = static_cast<M>(wire);
      return true;
    } else if constexpr (std::same_as<M, W>) {
      model = wire;
      return true;
    } else {
      return fields(*this, model, wire);
    }
  }

  bool not_negative(double& model, double wire) const { return (*this)(model, wire) && wire >= 0.0; }
  bool positive(double& model, double wire) const { return (*this)(model, wire) && wire > 0.0; }
  bool ratio(int& model, std::uint32_t wire) const { return (*this)(model, wire) && model >= 1 && model <= kMostRatio; }
  template <class E, class W>
  bool kind(E& model, W wire, E last) const {
    return (*this)(model, wire) && wire <= static_cast<W>(last);
  }
  bool same(BodyId model, std::uint32_t wire) const { return wire == index(model); }
  bool check(bool valid) const { return valid; }

  void resize(auto& model, const auto& wire) const { model.resize(wire.size()); }
  bool length(const auto& wire, std::size_t size) const { return wire.size() == size; }
  void present(auto& model, bool wire) const {
    model.reset();
    if (wire) model.emplace();
  }
  template <class W>
  void present(auto& model, const std::vector<W>& wire) const {
    present(model, !wire.empty());
  }
};

}  // namespace subworld
