#include "brash_ice_rig/rviz/force_plot.h"

#include <algorithm>

#include <qwt_plot_canvas.h>
#include <qwt_plot_curve.h>
#include <qwt_plot_grid.h>
#include <qwt_plot_marker.h>
#include <qwt_symbol.h>
#include <QPen>
#include <QVector>

#include "brash_ice_rig/rviz/force_history.h"

namespace brash_ice_rig {
namespace {

constexpr double kKilo = 1.0e-3;
constexpr double kShortestTimeAxisS = 30.0;
constexpr double kLowestForceAxisKn = 1.0;

}  // namespace

// Qwt deletes what is attached to a plot together with it.
ForcePlot::ForcePlot(QWidget* parent)
    : QwtPlot(parent), curve_(new QwtPlotCurve), level_(new QwtPlotMarker), peak_(new QwtPlotMarker) {
  setCanvasBackground(Qt::white);
  QFont small = font();
  small.setPointSize(8);
  for (const int axis : {QwtPlot::yLeft, QwtPlot::xBottom}) setAxisFont(axis, small);
  if (auto* canvas = qobject_cast<QwtPlotCanvas*>(this->canvas())) canvas->setFrameStyle(QFrame::NoFrame);
  auto* grid = new QwtPlotGrid;
  grid->setMajorPen(QColor(225, 225, 225));
  grid->attach(this);
  level_->setLineStyle(QwtPlotMarker::HLine);
  level_->setLinePen(QColor(20, 130, 60), 1.0, Qt::DashLine);
  level_->attach(this);
  curve_->setPen(QColor(20, 60, 140), 1.5);
  curve_->setRenderHint(QwtPlotItem::RenderAntialiased);
  curve_->attach(this);
  peak_->setSymbol(new QwtSymbol(QwtSymbol::Ellipse, QColor(200, 30, 30), QColor(200, 30, 30), QSize(7, 7)));
  peak_->attach(this);
}

void ForcePlot::show(const ForceHistory& history) {
  const auto curve = history.curve();
  QVector<QPointF> points;
  points.reserve(static_cast<int>(curve.size()));
  double low_kn = 0.0, high_kn = kLowestForceAxisKn;
  for (const ForcePoint& point : curve) {
    points.append(QPointF(point.time_s, kKilo * point.force_n));
    low_kn = std::min(low_kn, kKilo * point.force_n);
    high_kn = std::max(high_kn, kKilo * point.force_n);
  }
  curve_->setSamples(points);
  const auto level = history.level();
  level_->setVisible(level.has_value());
  if (level) level_->setYValue(kKilo * level->force_n);
  const auto peak = history.peak();
  peak_->setVisible(peak.has_value());
  if (peak) peak_->setValue(peak->time_s, kKilo * peak->force_n);

  const double begin_s = curve.empty() ? 0.0 : curve.front().time_s;
  const double end_s = curve.empty() ? 0.0 : curve.back().time_s;
  setAxisScale(QwtPlot::xBottom, begin_s, std::max(end_s, begin_s + kShortestTimeAxisS));
  setAxisScale(QwtPlot::yLeft, 1.1 * low_kn, 1.1 * high_kn);
  replot();
}

}  // namespace brash_ice_rig
