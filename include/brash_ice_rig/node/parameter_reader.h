#pragma once

#include <cmath>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <XmlRpcValue.h>
#include <ros/node_handle.h>

#include "brash_ice_rig/config/config_error.h"
#include "brash_ice_rig/node/live_options.h"
#include "brash_ice_rig/node/split_list.h"

namespace brash_ice_rig {

/// For messages.
inline std::string valueText(XmlRpc::XmlRpcValue value) {
  using XmlRpc::XmlRpcValue;
  std::ostringstream text;
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value) ? "true" : "false";
    case XmlRpcValue::TypeInt:
      text << static_cast<int>(value);
      return text.str();
    case XmlRpcValue::TypeDouble:
      text << static_cast<double>(value);
      return text.str();
    case XmlRpcValue::TypeString:
      return "\"" + static_cast<std::string>(value) + "\"";
    case XmlRpcValue::TypeArray:
      return "(a list)";
    default:
      return "(a structure)";
  }
}

/// Reads private parameters and remembers their names, so that a misspelt one can be told from one of ours. What is not
/// set leaves its target as it is. Throws ConfigError naming parameter, value and rule.
class ParameterReader {
 public:
  using XmlRpcValue = XmlRpc::XmlRpcValue;

  explicit ParameterReader(const ros::NodeHandle& node) : node_(node) {}

  void read(const std::string& name, std::string& target) {
    XmlRpcValue value;
    if (!find(name, value)) return;
    if (value.getType() != XmlRpcValue::TypeString) refuse(name, value, "must be a text");
    target = static_cast<std::string>(value);
  }

  void read(const std::string& name, bool& target) {
    XmlRpcValue value;
    if (!find(name, value)) return;
    if (value.getType() != XmlRpcValue::TypeBoolean) refuse(name, value, "must be true or false");
    target = static_cast<bool>(value);
  }

  void read(const std::string& name, double& target, double min, double max) {
    read(name, target, ParameterRange{min, max});
  }

  void read(const std::string& name, double& target, const ParameterRange& range) {
    XmlRpcValue value;
    if (!find(name, value)) return;
    double number = std::nan("");
    if (value.getType() == XmlRpcValue::TypeDouble) number = static_cast<double>(value);
    if (value.getType() == XmlRpcValue::TypeInt) number = static_cast<int>(value);
    if (!range.contains(number)) refuse(name, value, range.rule());
    target = number;
  }

  /// A list of texts, or one text with ; between the entries.
  void read(const std::string& name, std::vector<std::string>& target) {
    XmlRpcValue value;
    if (!find(name, value)) return;
    if (value.getType() == XmlRpcValue::TypeString) {
      target = splitList(static_cast<std::string>(value));
      return;
    }
    const char* rule = "must be a list of texts, or one text with ; between the entries";
    if (value.getType() != XmlRpcValue::TypeArray) refuse(name, value, rule);
    target.clear();
    for (int i = 0; i < value.size(); ++i) {
      if (value[i].getType() != XmlRpcValue::TypeString) refuse(name, value[i], rule);
      target.push_back(static_cast<std::string>(value[i]));
    }
  }

  void allow(const std::string& name) { known_.insert(node_.resolveName(name)); }

  [[noreturn]] void refuse(const std::string& name, const XmlRpcValue& value, const std::string& rule) const {
    throw ConfigError(node_.resolveName(name), valueText(value), rule);
  }

  /// @throws ConfigError if the private namespace holds a parameter that nobody has asked for
  void refuseUnknown() const {
    std::vector<std::string> names;
    node_.getParamNames(names);
    const std::string own = node_.getNamespace() + "/";
    for (const std::string& name : names) {
      if (name.compare(0, own.size(), own) != 0) continue;
      const std::string top = name.substr(0, name.find('/', own.size()));
      if (known_.count(top) != 0) continue;
      std::string list;
      for (const std::string& known : known_) list += (list.empty() ? "" : ", ") + known.substr(own.size());
      XmlRpcValue value;
      node_.getParam(top, value);
      throw ConfigError(top, valueText(value), "unknown parameter; known are: " + list);
    }
  }

 private:
  bool find(const std::string& name, XmlRpcValue& value) {
    allow(name);
    return node_.getParam(name, value);
  }

  ros::NodeHandle node_;
  std::set<std::string> known_;
};

}  // namespace brash_ice_rig
