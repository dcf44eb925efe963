#include "brash_ice_rig/rviz/spring_slider.h"

#include <QMouseEvent>
#include <QStyle>
#include <QStyleOptionSlider>

namespace brash_ice_rig {

SpringSlider::SpringSlider(Qt::Orientation orientation, QWidget* parent) : QSlider(orientation, parent) {
  setRange(-kEnd, kEnd);
  setValue(0);
  setFocusPolicy(Qt::NoFocus);
  setTickPosition(QSlider::TicksBothSides);
  setTickInterval(kEnd);
  // Styles fill the groove from one end to the handle: a slider at rest would look half full.
  QPalette colors = palette();
  colors.setColor(QPalette::Highlight, colors.color(QPalette::Mid));
  setPalette(colors);
}

bool SpringSlider::event(QEvent* event) {
  switch (event->type()) {
    case QEvent::Hide:
    case QEvent::UngrabMouse:
    case QEvent::WindowDeactivate:
      letGo();
      break;
    case QEvent::EnabledChange:
      if (!isEnabled()) letGo();
      break;
    default:
      break;
  }
  return QSlider::event(event);
}

void SpringSlider::mousePressEvent(QMouseEvent* event) {
  if (event->button() != Qt::LeftButton) return;
  setSliderDown(true);
  setValue(valueAt(event->pos()));
}

void SpringSlider::mouseMoveEvent(QMouseEvent* event) {
  if (!isSliderDown()) return;
  if ((event->buttons() & Qt::LeftButton) != 0) {
    setValue(valueAt(event->pos()));
  } else {
    letGo();
  }
}

void SpringSlider::mouseReleaseEvent(QMouseEvent* event) {
  if (event->button() == Qt::LeftButton) letGo();
}

void SpringSlider::wheelEvent(QWheelEvent* event) {
  event->ignore();
}

void SpringSlider::keyPressEvent(QKeyEvent* event) {
  event->ignore();
}

int SpringSlider::valueAt(const QPoint& point) const {
  QStyleOptionSlider option;
  initStyleOption(&option);
  const QRect groove = style()->subControlRect(QStyle::CC_Slider, &option, QStyle::SC_SliderGroove, this);
  const QRect handle = style()->subControlRect(QStyle::CC_Slider, &option, QStyle::SC_SliderHandle, this);
  const bool flat = orientation() == Qt::Horizontal;
  // The middle of the handle follows the mouse.
  const int span = flat ? groove.width() - handle.width() : groove.height() - handle.height();
  const int position =
      flat ? point.x() - groove.x() - handle.width() / 2 : point.y() - groove.y() - handle.height() / 2;
  return QStyle::sliderValueFromPosition(minimum(), maximum(), position, span, option.upsideDown);
}

void SpringSlider::letGo() {
  if (!isSliderDown()) return;
  setSliderDown(false);
  setValue(0);
}

}  // namespace brash_ice_rig
