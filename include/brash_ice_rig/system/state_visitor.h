#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include <Eigen/Core>

namespace brash_ice_rig {

/// Walks what an object remembers from step to step: to hash it, to save it, and to load it. Each class has one walk,
/// visitState(), for all three, so that what is saved is what is hashed.
///
/// A name is at most 63 characters long and stands in the file, so that a file of another layout is told from ours.
/// When loading, the object is one that was made anew from the same scenario. An array keeps the length that it has
/// there: a file is untrusted, and what reads an array relies on its length. list() is for others.
class StateVisitor {
 public:
  virtual ~StateVisitor() = default;

  /// Values are being written into the object. What follows from them has to be made anew after the walk.
  virtual bool loading() const { return false; }

  /// Says that a loaded value cannot be. @throws ConfigError naming the file
  [[noreturn]] virtual void refuse(const std::string& reason) const { throw std::logic_error(reason); }

  template <class Number, std::enable_if_t<std::is_arithmetic_v<Number>, int> = 0>
  void operator()(const char* name, Number& value) {
    begin(name, 1, sizeof value, Length::kFixed);
    bytes(&value, sizeof value);
  }

  void operator()(const char* name, bool& value) {
    auto byte = static_cast<unsigned char>(value ? 1 : 0);  // a bool that holds anything else has no meaning
    (*this)(name, byte);
    value = byte != 0;
  }

  template <class Number, int Rows, int Columns>
  void operator()(const char* name, Eigen::Matrix<Number, Rows, Columns>& value) {
    static_assert(Rows > 0 && Columns > 0, "of fixed size only");
    begin(name, static_cast<std::size_t>(value.size()), sizeof(Number), Length::kFixed);
    bytes(value.data(), sizeof(Number) * static_cast<std::size_t>(value.size()));
  }

  void operator()(const char* name, std::string& text) {
    text.resize(begin(name, text.size(), 1, Length::kAny));
    bytes(text.data(), text.size());
  }

  template <class Number, class Allocator, std::enable_if_t<std::is_arithmetic_v<Number>, int> = 0>
  void operator()(const char* name, std::vector<Number, Allocator>& values) {
    records(name, values);
  }

  template <class Number, std::size_t kCount>
  void operator()(const char* name, std::array<std::vector<Number>, kCount>& arrays) {
    for (auto& values : arrays) records(name, values);
  }

  template <class Value>
  void operator()(const char* name, std::optional<Value>& value) {
    bool has = value.has_value();
    (*this)(name, has);
    if (has && !value) value.emplace();
    if (!has) value.reset();
    if (value) (*this)(name, *value);
  }

  /// An array of plain records without padding, such as vectors of three numbers.
  template <class Record, class Allocator>
  void records(const char* name, std::vector<Record, Allocator>& values) {
    visitArray(name, values, Length::kFixed);
  }

  /// The same of any length.
  template <class Record>
  void list(const char* name, std::vector<Record>& values) {
    visitArray(name, values, Length::kAny);
  }

 protected:
  enum class Length {
    kFixed,  ///< the present one
    kAny,
  };

  /// The next value begins.
  /// @param count  present number of elements of the given size, bytes
  /// @return number of elements that follow by bytes()
  virtual std::size_t begin(const char* name, std::size_t count, std::size_t size, Length length) = 0;
  virtual void bytes(void* data, std::size_t count) = 0;

 private:
  template <class Array>
  void visitArray(const char* name, Array& values, Length length) {
    const std::size_t size = sizeof(typename Array::value_type);
    const std::size_t count = begin(name, values.size(), size, length);
    if (count != values.size()) values.resize(count);
    bytes(values.data(), count * size);
  }
};

}  // namespace brash_ice_rig
