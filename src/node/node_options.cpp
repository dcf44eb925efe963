#include "brash_ice_rig/node/node_options.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <vector>

#include <XmlRpcValue.h>

#include "brash_ice_rig/node/split_list.h"

namespace brash_ice_rig {
namespace {

using XmlRpc::XmlRpcValue;

std::string valueText(XmlRpcValue value) {
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

/// Reads private parameters and remembers their names, so that a misspelt one can be told from one of ours.
class ParameterReader {
 public:
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

  /// @param zero_allowed  0 counts as in range although min is higher
  void read(const std::string& name, double& target, double min, double max, bool zero_allowed = false) {
    XmlRpcValue value;
    if (!find(name, value)) return;
    double number = std::nan("");
    if (value.getType() == XmlRpcValue::TypeDouble) number = static_cast<double>(value);
    if (value.getType() == XmlRpcValue::TypeInt) number = static_cast<int>(value);
    const bool good = (zero_allowed && number == 0.0) || (number >= min && number <= max);
    if (!good) {
      std::ostringstream rule;
      rule << "must be a number in [" << min << ", " << max << "]" << (zero_allowed ? " or 0" : "");
      refuse(name, value, rule.str());
    }
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

}  // namespace

bool isPlainFileName(const std::string& name) {
  const auto printable = [](char c) { return static_cast<unsigned char>(c) >= 0x20 && c != 0x7f && c != '/'; };
  return !name.empty() && name.size() <= 200 && name.front() != '.' && std::all_of(name.begin(), name.end(), printable);
}

NodeOptions readNodeOptions(const ros::NodeHandle& private_node) {
  NodeOptions options;
  ParameterReader reader(private_node);
  reader.allow("diagnostic_period");  // read by diagnostic_updater

  reader.read("scenario", options.sources.file);
  reader.read("overlays", options.sources.overlays);
  reader.read("settings", options.sources.settings);
  reader.read("output_dir", options.output_dir);
  reader.read("real_time_factor", options.real_time_factor, 0.001, 1000.0, true);
  reader.read("start_paused", options.start_paused);
  reader.read("exit_at_end", options.exit_at_end);
  reader.read("publish_clock", options.publish_clock);
  reader.read("frame_prefix", options.frame_prefix);
  reader.read("points_rate_hz", options.points_rate_hz, 0.1, 1000.0);
  reader.read("markers_rate_hz", options.markers_rate_hz, 0.1, 1000.0);
  reader.read("state_rate_hz", options.state_rate_hz, 0.1, 1000.0);
  reader.read("joints_rate_hz", options.joints_rate_hz, 0.1, 1000.0);
  reader.read("status_rate_hz", options.status_rate_hz, 0.1, 100.0);
  reader.read("checkpoint_dir", options.checkpoint_dir);
  reader.read("checkpoint_file", options.checkpoint_file);
  reader.read("checkpoint_every_s", options.checkpoint_every_s, 0.1, 86400.0, true);
  std::string working_dir;
  reader.read("working_dir", working_dir);
  reader.refuseUnknown();

  if (!options.frame_prefix.empty() && options.frame_prefix.front() == '/') {
    reader.refuse("frame_prefix", options.frame_prefix, "must not begin with a slash");
  }
  if (!isPlainFileName(options.checkpoint_file)) {
    reader.refuse("checkpoint_file", options.checkpoint_file,
                  "must be the plain name of a file: no slash, no dot at the beginning");
  }
  if (options.checkpoint_every_s > 0.0 && options.checkpoint_dir.empty()) {
    reader.refuse("checkpoint_every_s", options.checkpoint_every_s, "needs ~checkpoint_dir");
  }
  if (!working_dir.empty() && chdir(working_dir.c_str()) != 0) {
    reader.refuse("working_dir", working_dir, "must be a directory that exists");
  }
  if (options.sources.file.empty()) {
    reader.refuse("scenario", options.sources.file, "must name a scenario file");
  }
  return options;
}

}  // namespace brash_ice_rig
