#pragma once

#include <qwt_plot.h>

class QwtPlotCurve;
class QwtPlotMarker;

namespace brash_ice_rig {

class ForceHistory;

/// The load cell's reading in kN over the time of the test in s: a curve, a dot at its peak, a dashed line at its
/// present level.
class ForcePlot : public QwtPlot {
 public:
  explicit ForcePlot(QWidget* parent = nullptr);
  void show(const ForceHistory& history);

 private:
  QwtPlotCurve* curve_;
  QwtPlotMarker* level_;
  QwtPlotMarker* peak_;
};

}  // namespace brash_ice_rig
