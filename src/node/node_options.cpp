#include "brash_ice_rig/node/node_options.h"

#include <unistd.h>

#include <algorithm>

#include "brash_ice_rig/node/parameter_reader.h"

namespace brash_ice_rig {

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
  LiveOptions::visit(options.live, [&](const char* name, auto&&... value) { reader.read(name, value...); });
  reader.read("start_paused", options.start_paused);
  reader.read("exit_at_end", options.exit_at_end);
  reader.read("publish_clock", options.publish_clock);
  reader.read("frame_prefix", options.frame_prefix);
  reader.read("scenario_dir", options.scenario_dir);
  reader.read("checkpoint_dir", options.checkpoint_dir);
  reader.read("checkpoint_file", options.checkpoint_file);
  reader.read("checkpoint_every_s", options.checkpoint_every_s, ParameterRange{0.1, 86400.0, true});
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
